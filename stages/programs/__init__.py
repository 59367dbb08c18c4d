"""Shape programs: named parameters with ranges in, parts of a shape out (geocode §3)."""
