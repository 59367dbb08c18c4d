"""What a set of programs is like: lines, macros, leaf parts (shapeassembly tables 3 and 5), clusters (figure 10)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.analysis.structure import block_signatures, signature
from stages.shapeassembly.execution.interpreter import execute_all
from stages.shapeassembly.syntax.program import AssemblyProgram, Reflect, Squeeze, Translate


@dataclass(frozen=True)
class ProgramStatistics:
    """Means over programs. Lines are counted with those of the bounding boxes, without heads and braces; macros are
    shares of all lines, not means of shares; leaf_parts counts the cuboids of the executed programs."""

    programs: int
    lines: float
    reflects: float
    translates: float
    squeezes: float
    leaf_parts: float

    @property
    def macros(self) -> float:
        """Macros a line, all kinds."""
        return self.reflects + self.translates + self.squeezes


def program_statistics(programs: Sequence[AssemblyProgram]) -> ProgramStatistics:
    """Raises ProgramError where a program cannot be executed, ValueError where there is none."""
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


def cluster_curve(signatures: Iterable[str]) -> FloatArray:
    """Share of all items that the 1, 2, 3, ... most frequent structures have between them, float64 (structures,)."""
    counts = np.array(sorted(Counter(signatures).values(), reverse=True), dtype=np.float64)
    curve: FloatArray = np.cumsum(counts) / max(counts.sum(), 1)
    return curve


def cluster_curves(programs: Sequence[AssemblyProgram]) -> tuple[FloatArray, FloatArray]:
    """`cluster_curve` of whole programs, and of their assemblies by themselves."""
    whole = cluster_curve(signature(program) for program in programs)
    return whole, cluster_curve(each for program in programs for each in block_signatures(program))
