"""Shape graphs as SMILES-like strings and back, and the text corpus of a dataset (strings §5.1)."""
