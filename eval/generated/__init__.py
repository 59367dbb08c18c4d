"""Metrics about shapes that models generate from strings."""
