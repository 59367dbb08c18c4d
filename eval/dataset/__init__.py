"""Metrics about finished datasets."""
