"""The shipped exemplars: small modular kits authored in code, two example shapes each.

What gives a kit many variants (strings §4): connectors in the same local frame, junctions on a regular lattice,
single-boundary joints along with closed loops, and tops that stack. What keeps its grammar restrictive: no part looks
the same upside down, parts that do not touch keep a clear distance, and no part is a hub.
"""
