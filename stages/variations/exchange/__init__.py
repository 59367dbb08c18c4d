"""Variation by exchange: a piece is cut out of one shape and docked into another (strings §3)."""
