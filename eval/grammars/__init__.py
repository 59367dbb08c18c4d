"""Metrics about shape grammars and r-similarity."""
