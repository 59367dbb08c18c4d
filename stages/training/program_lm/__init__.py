"""Models that write ShapeAssembly programs word by word: a language model whose mask is the grammar."""
