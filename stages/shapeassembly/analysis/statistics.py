"""Statistics of programs: lines, macros, leaf parts (shapeassembly tables 3 and 5), clusters (figure 10)."""

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


def cluster_curve(signatures: Iterable[str]) -> FloatArray:
    """Return the share of all items that have the 1, 2, 3, ... most frequent structures, float64 (structures,)."""
    counts = np.array(sorted(Counter(signatures).values(), reverse=True), dtype=np.float64)
    curve: FloatArray = np.cumsum(counts) / max(counts.sum(), 1)
    return curve


def cluster_curves(programs: Sequence[AssemblyProgram]) -> tuple[FloatArray, FloatArray]:
    """Return `cluster_curve` of whole programs, and of single assemblies."""
    whole = cluster_curve(signature(program) for program in programs)
    return whole, cluster_curve(block for program in programs for block in block_signatures(program))
