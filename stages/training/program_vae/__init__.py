"""The hierarchical sequence VAE of ShapeAssembly programs (shapeassembly §6)."""
