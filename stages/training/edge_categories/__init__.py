"""A model that predicts from a string how each part is placed relative to its parent (strings §6)."""
