"""Variation by exchange: a piece is cut out of one shape and docked in another (strings §3)."""
