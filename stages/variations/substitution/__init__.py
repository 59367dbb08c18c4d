"""Variation by substitution: parts of some meanings take their place from those of another shape (substructures §4)."""
