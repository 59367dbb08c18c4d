"""Lines are written so that cuboids reach what they are attached to, beyond the rules of shapeassembly App. D.

An aligned cuboid is not stretched where it is attached, and most chairs that fell had a leg or a back that was a little
too short. It gets the size with which it reaches all that it is attached to, where there is one.
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
"""How far a cuboid may stand from where it is attached, as a share of the diagonal of the bounding box: half of what
connects parts (shapeassembly App. E)."""

MIN_OPPOSITE_SHARE = 0.5
"""How far apart, as a share of a cuboid's size, two of its points are that say how large it should be."""


def add_line(draft: PartialAssembly, choice: LineChoice, numbers: LineNumbers, *, reaching: bool) -> bool:
    """Writes a line, if it keeps the rules; whether it does. An aligned cuboid that would not reach where it is
    attached gets the size with which it does, if that keeps the rules too. With `reaching` a line is not written after
    which a cuboid still does not."""
    found = draft.line(choice, numbers)
    if found is None:
        return False
    line, moved = found[0], choice[1]
    written = draft.with_line(line, moved)
    resized = _resized(written, moved) if isinstance(line, Attach | Squeeze) else None
    for each in (written,) if resized is None else (resized, written):
        if each.fits() and not (reaching and attachment_gap(each, moved) > MAX_GAP_SHARE):
            draft.sizes = each.sizes
            draft.put(choice, *found)
            return True
    return False


def attachment_gap(draft: PartialAssembly, moved: int) -> float:
    """How far the cuboid of a slot stands from where it is attached, at most, as a share of the diagonal of the
    bounding box; infinite where the assembly cannot be executed."""
    ends = _ends(draft, moved)
    return np.inf if ends is None else _farthest(ends[1], ends[2], draft.box)


def _resized(draft: PartialAssembly, moved: int) -> PartialAssembly | None:
    """With the sizes of an aligned cuboid by which it comes nearer to all that it is attached to; None where its own
    serve, or none are better."""
    ends = _ends(draft, moved) if draft.aligned[moved - 1] else None
    if ends is None or _farthest(ends[1], ends[2], draft.box) <= MAX_GAP_SHARE:
        return None
    own, stands, wanted = ends
    sizes = list(draft.sizes[moved - 1])
    for axis in range(3):
        low, high = own[:, axis].argmin(), own[:, axis].argmax()
        if own[high, axis] - own[low, axis] >= MIN_OPPOSITE_SHARE:
            size = (wanted[high, axis] - wanted[low, axis]) / (own[high, axis] - own[low, axis])
            sizes[axis] = round(float(size), 3)
    if any(not MIN_CUBOID_SIZE <= size <= most for size, most in zip(sizes, draft.box, strict=True)):
        return None
    x, y, z = sizes
    resized = replace(draft, sizes=[*draft.sizes[: moved - 1], (x, y, z), *draft.sizes[moved:]])
    return resized if attachment_gap(resized, moved) < _farthest(stands, wanted, draft.box) else None


def _ends(draft: PartialAssembly, moved: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Where the cuboid of a slot is attached (`attachment_points`); None where the assembly cannot be executed."""
    try:
        return attachment_points(draft.block("Program_0", {}), f"cube{draft.grounded.index(moved)}")
    except ProgramError:
        return None


def _farthest(stands: FloatArray, wanted: FloatArray, box: Point) -> float:
    """The largest distance of points (n, 3) from others, as a share of the diagonal of a bounding box."""
    return float(np.linalg.norm(stands - wanted, axis=1).max(initial=0.0) / np.linalg.norm(box))
