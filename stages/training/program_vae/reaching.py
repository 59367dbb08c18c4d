"""Resize aligned cuboids so that they reach what they are attached to, beyond the rules of shapeassembly App. D.

Attachments do not stretch an aligned cuboid, and most sampled chairs that fell had a leg or back slightly too short.
Such a cuboid gets the size with which it reaches all its attachments, where one exists.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.attachment_points import attachment_points
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import Attach, Point, Squeeze
from stages.training.program_vae.partial_assembly import LineChoice, LineNumbers, PartialAssembly

MAX_GAP_SHARE = 0.01
"""Maximum gap between a cuboid and its attachment, as a share of the bounding box's diagonal: half of what connects
parts (shapeassembly App. E).
"""

MIN_OPPOSITE_SHARE = 0.5
"""Minimum distance, as a share of a cuboid's size, of two attached points that determine the size."""


def add_line(draft: PartialAssembly, choice: LineChoice, numbers: LineNumbers, *, reaching: bool) -> bool:
    """Add a line if it keeps the rules. Returns whether it does.

    An aligned cuboid that would not reach its attachments is resized, if that keeps the rules too.
    reaching: refuse a line after which the cuboid does not reach them.
    """
    checked = draft.line(choice, numbers)
    if checked is None:
        return False
    line, moved = checked[0], choice[1]
    extended = draft.with_line(line, moved)
    resized = _resized(extended, moved) if isinstance(line, Attach | Squeeze) else None
    for candidate in (extended,) if resized is None else (resized, extended):
        if candidate.fits() and not (reaching and attachment_gap(candidate, moved) > MAX_GAP_SHARE):
            draft.sizes = candidate.sizes
            draft.put(choice, *checked)
            return True
    return False


def attachment_gap(draft: PartialAssembly, moved: int) -> float:
    """Return the largest gap between a cuboid and its attachments, as a share of the bounding box's diagonal; infinite
    where the assembly cannot be executed.
    """
    ends = _ends(draft, moved)
    return np.inf if ends is None else _farthest(ends[1], ends[2], draft.box)


def _resized(draft: PartialAssembly, moved: int) -> PartialAssembly | None:
    """Return the assembly with a better size of an aligned cuboid; None where its own serves, or none is better."""
    ends = _ends(draft, moved) if draft.aligned[moved - 1] else None
    if ends is None or _farthest(ends[1], ends[2], draft.box) <= MAX_GAP_SHARE:
        return None
    local, actual, wanted = ends
    sizes = list(draft.sizes[moved - 1])
    for axis in range(3):
        low, high = local[:, axis].argmin(), local[:, axis].argmax()
        if local[high, axis] - local[low, axis] >= MIN_OPPOSITE_SHARE:
            size = (wanted[high, axis] - wanted[low, axis]) / (local[high, axis] - local[low, axis])
            sizes[axis] = round(float(size), 3)
    if any(not MIN_CUBOID_SIZE <= size <= limit for size, limit in zip(sizes, draft.box, strict=True)):
        return None
    x, y, z = sizes
    resized = replace(draft, sizes=[*draft.sizes[: moved - 1], (x, y, z), *draft.sizes[moved:]])
    return resized if attachment_gap(resized, moved) < _farthest(actual, wanted, draft.box) else None


def _ends(draft: PartialAssembly, moved: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return `attachment_points` of a cuboid; None where the assembly cannot be executed."""
    try:
        return attachment_points(draft.block("Program_0", {}), f"cube{draft.grounded.index(moved)}")
    except ProgramError:
        return None


def _farthest(actual: FloatArray, wanted: FloatArray, box: Point) -> float:
    """Return the largest distance between points (n, 3), as a share of the bounding box's diagonal."""
    return float(np.linalg.norm(actual - wanted, axis=1).max(initial=0.0) / np.linalg.norm(box))
