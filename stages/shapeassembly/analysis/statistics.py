"""Statistics of programs: lines, macros, leaf parts (shapeassembly tables 3 and 5)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from stages.shapeassembly.execution.interpreter import execute_all
from stages.shapeassembly.syntax.program import AssemblyProgram, Reflect, Squeeze, Translate


@dataclass(frozen=True)
class ProgramStatistics:
    """Means over programs.

    lines: with those of the bounding boxes, without heads and braces.
    reflects, translates, squeezes: shares of all lines, not means of shares.
    leaf_parts: cuboids of the executed program.
    """

    programs: int
    lines: float
    reflects: float
    translates: float
    squeezes: float
    leaf_parts: float

    @property
    def macros(self) -> float:
        """Macros of all kinds, as a share of all lines."""
        return self.reflects + self.translates + self.squeezes


def program_statistics(programs: Sequence[AssemblyProgram]) -> ProgramStatistics:
    """Compute the statistics. Raises ProgramError where a program cannot be executed, ValueError for no programs."""
    if not programs:
        raise ValueError("no programs")
    kinds = Counter(type(line) for program in programs for block in program.blocks for line in block.lines)
    lines = kinds.total() + sum(len(program.blocks) for program in programs)
    leaves = sum(len(execution) for execution in execute_all(programs))
    return ProgramStatistics(
        programs=len(programs),
        lines=lines / len(programs),
        reflects=kinds[Reflect] / lines,
        translates=kinds[Translate] / lines,
        squeezes=kinds[Squeeze] / lines,
        leaf_parts=leaves / len(programs),
    )
