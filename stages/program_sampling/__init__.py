"""Samples ShapeAssembly programs from trained models for stage `shapeassembly` (shapeassembly §6.1)."""
