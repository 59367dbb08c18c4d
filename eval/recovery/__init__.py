"""Metrics about recovered parameters."""
