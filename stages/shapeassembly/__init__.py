"""ShapeAssembly: the language of attached cuboids, its interpreters, and programs from part hierarchies."""

from __future__ import annotations

from stages.shapeassembly.parser import parse
from stages.shapeassembly.printer import print_program

__all__ = ["parse", "print_program"]
