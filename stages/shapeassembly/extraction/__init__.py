"""From part hierarchies to ShapeAssembly programs (shapeassembly §5, App. C)."""
