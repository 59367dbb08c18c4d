"""Pictures of models and their variants next to those of other renderers, and what loaders show of textures."""
