"""Geometry of parts: poses, triangles, docking, the one contact test, how deep parts reach into each other."""
