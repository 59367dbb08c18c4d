"""Partial symmetries of one surface: where a surface repeats, and the pieces that this cuts it into."""
