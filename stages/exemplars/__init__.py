"""Meshes to kits: parts, part types, contacts, shape graphs and the tiling grammar (strings §3)."""
