"""One unsegmented mesh -> a shape grammar, and random and resized shapes of that grammar (symmetry §3.4, §4.2)."""
