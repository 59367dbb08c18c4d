"""ShapeAssembly: the language of attached cuboids, its interpreters, and programs from part hierarchies."""

from __future__ import annotations

from stages.shapeassembly.execution.interpreter import Execution, execute, execute_all
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.printer import print_program

__all__ = ["Execution", "ProgramError", "execute", "execute_all", "parse", "print_program"]
