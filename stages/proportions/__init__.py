"""Exemplars -> the same in other proportions: parts longer, wider, thicker, still joined (substructures §5.2)."""
