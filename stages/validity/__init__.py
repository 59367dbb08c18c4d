"""Check each sample of a collection physically: does it stand? The verdict goes to its record and two arrays."""
