"""The shipped exemplars: small modular kits authored in code, two example shapes each.

A kit has many variants (strings §4) if connectors recur in the same local frame, junctions lie on a regular lattice,
single-boundary joints occur along with closed loops, and tops stack. Its grammar stays restrictive if no part looks the
same upside down, parts that do not touch keep a clear distance, and no part is a hub.
"""
