"""Rows: congruent parts at equal steps, along a line or about an axis; periods are inserted and removed."""
