"""ShapeAssembly syntax: the program tree, its text and its rules."""
