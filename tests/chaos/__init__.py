"""Chaos: runs over the real stages are killed, starved and spoilt at random moments, and must end as if nothing was."""
