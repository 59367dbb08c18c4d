"""Models that write ShapeAssembly programs: the hierarchical sequence VAE (shapeassembly §6)."""
