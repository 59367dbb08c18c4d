"""Each sample of a collection is judged: does it stand? What is found becomes fields of its record and two arrays."""
