"""The search that all methods share: parents, what to try next, and what counts as a new variant."""
