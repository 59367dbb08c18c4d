"""Model files -> scenes: one reader a format, and what they share; `read_model` is the way in."""
