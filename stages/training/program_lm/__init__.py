"""A language model of ShapeAssembly programs, masked by the grammar."""
