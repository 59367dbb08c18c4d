"""Variation by replaceable substructures: all that can take each other's place along a common boundary (substructures
§4)."""
