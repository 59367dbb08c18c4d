"""Chaos tests: faults at random moments of runs over the real stages, whose files must come out as without."""
