"""The shipped exemplars: small modular kits authored in code, two example shapes each.

What makes a kit rich in variations (strings §4): connectors that recur everywhere in the same local frame, junctions
on a regular lattice, single-boundary joints beside closed loops, tops that stack. What keeps its rules restrictive:
no part looks the same upside down, parts that are not meant to touch stand clear of each other, and no part is a hub.
"""
