"""Curve programs: shapes from interpretable parameters (geocode)."""
