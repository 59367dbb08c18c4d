"""Model files -> scenes: one reader a format, and what they share."""
