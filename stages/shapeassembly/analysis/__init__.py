"""Program analysis: signatures, distances and statistics."""
