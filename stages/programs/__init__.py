"""Curve programs: parameters with names and ranges in, parts of a shape out (geocode §3)."""
