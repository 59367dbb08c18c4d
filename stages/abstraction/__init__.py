"""Samples as ShapeAssembly programs: their parts as boxes, gathered into a hierarchy, from which a program is extracted
(shapeassembly §5). One model of programs can so learn from whatever makes samples."""
