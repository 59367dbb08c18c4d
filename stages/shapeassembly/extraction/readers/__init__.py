"""Readers of part hierarchies, by file format."""
