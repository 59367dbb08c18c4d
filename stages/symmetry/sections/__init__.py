"""Cross sections of a surface, and the parallel planes at which it can be cut."""
