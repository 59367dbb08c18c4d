"""A model that reads from a string where each part stands (strings §6)."""
