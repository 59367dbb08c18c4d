"""Replaceable substructures: all pieces of two shapes that can take each other's place (substructures §4, §5)."""
