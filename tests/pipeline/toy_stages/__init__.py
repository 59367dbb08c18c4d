"""Four stages of a real mill, small enough to see through, that fail in every way when their config says so."""
