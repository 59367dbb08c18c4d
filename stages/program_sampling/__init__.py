"""Trained models write ShapeAssembly programs, which stage `shapeassembly` makes shapes of (shapeassembly §6.1)."""
