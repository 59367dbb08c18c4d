"""Extract ShapeAssembly programs from part hierarchies (shapeassembly §5, App. C)."""
