"""Resize aligned cuboids so that they reach what they are attached to, beyond the rules of shapeassembly App. D.

Attachments do not stretch an aligned cuboid, and most sampled chairs that fell had a leg or back slightly too short.
Such a cuboid gets the size with which it reaches all its attachments, where one exists.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.attachment_points import attachment_points
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import Attach, Point, Squeeze
from stages.training.program_vae.partial_assembly import LineChoice, LineNumbers, PartialAssembly, slot_name

Ends = tuple[FloatArray, FloatArray, FloatArray]
"""As `attachment_points` returns them: own local points of a cuboid, their positions, and where they should be."""

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
    candidates = _candidates(extended, moved) if isinstance(line, Attach | Squeeze) else ((extended, 0.0),)
    for candidate, gap in candidates:
        if not (reaching and gap > MAX_GAP_SHARE) and candidate.fits():
            draft.sizes = candidate.sizes
            draft.put(choice, *checked)
            return True
    return False


def attachment_gap(draft: PartialAssembly, moved: int) -> float:
    """Return the largest gap between a cuboid and its attachments, as a share of the bounding box's diagonal; infinite
    where the assembly cannot be executed.
    """
    return _gap(_ends(draft, moved), draft.box)


def _candidates(draft: PartialAssembly, moved: int) -> Iterator[tuple[PartialAssembly, float]]:
    """Yield the assembly with the `attachment_gap` of a cuboid; before it, where the cuboid is aligned and leaves a
    gap, the assembly with a better size of it, if there is one.
    """
    ends = _ends(draft, moved)
    gap = _gap(ends, draft.box)
    if ends is not None and draft.aligned[moved - 1] and gap > MAX_GAP_SHARE:
        resized = _resized(draft, moved, ends)
        if resized is not None and (resized_gap := attachment_gap(resized, moved)) < gap:
            yield resized, resized_gap
    yield draft, gap


def _resized(draft: PartialAssembly, moved: int, ends: Ends) -> PartialAssembly | None:
    """Return the assembly with the size of a cuboid that its attachments determine; None for one beyond the limits."""
    local, _, wanted = ends
    sizes = list(draft.sizes[moved - 1])
    for axis in range(3):
        low, high = local[:, axis].argmin(), local[:, axis].argmax()
        if local[high, axis] - local[low, axis] >= MIN_OPPOSITE_SHARE:
            size = (wanted[high, axis] - wanted[low, axis]) / (local[high, axis] - local[low, axis])
            sizes[axis] = round(float(size), 3)
    if any(not MIN_CUBOID_SIZE <= size <= limit for size, limit in zip(sizes, draft.box, strict=True)):
        return None
    x, y, z = sizes
    return replace(draft, sizes=[*draft.sizes[: moved - 1], (x, y, z), *draft.sizes[moved:]])


def _ends(draft: PartialAssembly, moved: int) -> Ends | None:
    """Return `attachment_points` of a cuboid; None where the assembly cannot be executed."""
    try:
        return attachment_points(draft.draft_block(), slot_name(moved))
    except ProgramError:
        return None


def _gap(ends: Ends | None, box: Point) -> float:
    """Return the largest distance between a cuboid and its attachments, as a share of the bounding box's diagonal."""
    if ends is None:
        return np.inf
    _, actual, wanted = ends
    return float(np.linalg.norm(actual - wanted, axis=1).max(initial=0.0) / np.linalg.norm(box))
