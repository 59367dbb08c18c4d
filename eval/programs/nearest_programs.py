"""The nearest programs by edit distance of their tokens."""

from __future__ import annotations

from collections.abc import Sequence

from stages.shapeassembly.analysis.structure import token_distance, tokens
from stages.shapeassembly.syntax.program import AssemblyProgram


def nearest_programs(programs: Sequence[AssemblyProgram], others: Sequence[AssemblyProgram]) -> list[tuple[int, int]]:
    """Return, for each program, the distance (`program_distance`) to the nearest of others, and its index."""
    known = [tokens(other) for other in others]
    nearest = []
    for words in map(tokens, programs):
        # The difference in length bounds the distance: programs of similar length come first, most others are skipped.
        best, which = len(words) + max(map(len, known)), -1
        gaps = [abs(len(other) - len(words)) for other in known]
        for index in sorted(range(len(known)), key=gaps.__getitem__):
            if gaps[index] >= best:
                break
            distance = token_distance(words, known[index])
            if distance < best:
                best, which = distance, index
        nearest.append((best, which))
    return nearest
