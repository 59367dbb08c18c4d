"""A stage in a house of its own: the mass of every part."""
