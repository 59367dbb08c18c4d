"""The search for variants: rounds of parallel searches, operator selection, parents, and the pool of what was found."""
