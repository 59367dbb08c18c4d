"""Metrics about strings: corpora, growth, compression, ambiguity, and string VAEs."""
