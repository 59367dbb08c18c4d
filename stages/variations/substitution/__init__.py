"""Substitution: parts of some labels are replaced by those of another shape, where types go by meaning."""
