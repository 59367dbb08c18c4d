"""Steps: translations that lead from parts to congruent parts, and the rows that they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.rows.layout import Layout
from stages.shape.arrays import BoolArray, FloatArray

MAX_STEP_SHARE = 0.75
"""Longest step, as a share of the box along its direction; a longer one joins the two ends of a shape, such as legs."""
MIN_STEP_TOLERANCES = 4.0
"""Shortest step, in tolerances of mates."""
MIN_COUNT = 2
MIN_PAIR_STEP_SHARE = 0.2
"""Shortest step of a row of two, as a share of the box along its direction; nearer pairs, such as two knobs, are not
rows.
"""
MAX_STEPS = 24
MIN_END_SHARE = 0.6
"""Least size across a bay of the parts at its ends, as a share of the shape's size there."""
MAX_BAYS = 8
"""Steps between whose parts a bay is looked for."""
MAX_NEIGHBOURS_PER_PART = 24
"""Nearest parts of its class that are considered for steps from a part."""
ROUNDING_DECIMALS = 9
MAX_SKEW = 0.02
"""Components of a step along other axes, as a share of the step, up to which it is a step along an axis."""
MIN_NORMAL_SHARE = 0.15
"""Axes along which a slanted step has at least this share of its length may be normals of its slab."""


@dataclass(frozen=True)
class Step:
    """A translation between congruent parts.

    shift: float64 (3,)
    count: parts of the longest row with this step
    parts: number of parts that have a part at this step
    is_bay: whether a period holds everything between two of these parts: a bay
    """

    shift: FloatArray
    count: int
    parts: int
    is_bay: bool = False

    @property
    def is_along_axis(self) -> bool:
        """Whether it is parallel to an axis."""
        return int(np.count_nonzero(self.shift)) == 1

    def normals(self) -> list[FloatArray]:
        """Return normals, float64 (3,) of length 1, of slabs that this step crosses."""
        length = float(np.linalg.norm(self.shift))
        axes = [np.eye(3)[axis] for axis in np.flatnonzero(np.abs(self.shift) >= MIN_NORMAL_SHARE * length)]
        upwards = [axis * np.sign(axis @ self.shift) for axis in axes]
        return upwards if self.is_along_axis else [*upwards, np.round(self.shift / length, ROUNDING_DECIMALS)]


def longest_row(mates: np.ndarray) -> int:
    """Return the number of parts of the longest row. mates: int64 (n,), as of `Layout.mates`."""
    has_previous = np.zeros(len(mates), dtype=bool)
    has_previous[mates[mates >= 0]] = True
    longest, row = 0, np.flatnonzero(~has_previous & (mates >= 0))
    length = 1
    while len(row) and length <= len(mates):
        row = mates[row]
        length += 1
        longest = max(longest, length)
        row = row[mates[row] >= 0]
    return longest


def with_long_rows(mates: np.ndarray, min_count: int) -> np.ndarray:
    """Return the mates of parts in rows of at least `min_count` parts, -1 for all others, int64 (n,).

    mates: int64 (n,), as of `Layout.mates`
    """
    previous = np.full(len(mates), -1, dtype=np.int64)
    previous[mates[mates >= 0]] = np.flatnonzero(mates >= 0)
    kept = np.full(len(mates), -1, dtype=np.int64)
    for start in np.flatnonzero((previous < 0) & (mates >= 0)).tolist():
        row = [start]
        while mates[row[-1]] >= 0 and len(row) <= len(mates):
            row.append(int(mates[row[-1]]))
        if len(row) >= min_count:
            kept[row[:-1]] = row[1:]
    return kept


def steps_of(layout: Layout) -> list[Step]:
    """Return the steps of a layout, those that most parts take first; of two opposite ones the one whose largest
    component is positive.
    """
    shifts = _shifts(layout)
    if not len(shifts):
        return []
    width = 2.0 * layout.mate_tolerance
    _, first, counts = np.unique(
        np.rint(shifts / width).astype(np.int64), axis=0, return_index=True, return_counts=True
    )
    order = np.lexsort((first, -counts))[: 4 * MAX_STEPS]
    steps: list[Step] = []
    for index in order.tolist():
        near = np.abs(shifts - shifts[first[index]]).max(axis=1) <= width
        shift = np.round(np.median(shifts[near], axis=0), ROUNDING_DECIMALS)
        if any(np.abs(step.shift - shift).max() <= layout.mate_tolerance for step in steps):
            continue
        mates = layout.mates(shift)
        count = longest_row(mates)
        if count > MIN_COUNT or (count == MIN_COUNT and _share(layout, shift) >= MIN_PAIR_STEP_SHARE):
            steps.append(Step(shift, count, int((mates >= 0).sum())))
    steps.sort(key=lambda step: (-step.parts, float(np.linalg.norm(step.shift)), *step.shift.tolist()))
    return _without_multiples(layout, steps)[:MAX_STEPS]


def bays_of(layout: Layout) -> list[Step]:
    """Return steps along an axis between parts with a bay between them, those that most parts take first.

    A multiple of a step of a longer row is left out: its bay is several periods of that row.
    """
    rows = [step.shift for step in steps_of(layout) if step.count > MIN_COUNT and step.is_along_axis]
    shifts = _shifts(layout, max_share=1.0)
    steps: list[Step] = []
    for axis in range(3):
        along = shifts[np.count_nonzero(shifts, axis=1) == 1][:, axis]
        lengths = np.sort(along[along > MIN_PAIR_STEP_SHARE * layout.extent[axis]])
        for group in np.split(lengths, np.flatnonzero(np.diff(lengths) > layout.mate_tolerance) + 1):
            if len(group):
                shift = np.round(np.median(group), ROUNDING_DECIMALS) * np.eye(3)[axis]
                mates = np.where(bay_ends(layout, shift), layout.mates(shift), -1)
                steps.append(Step(shift, longest_row(mates), int((mates >= 0).sum()), is_bay=True))
    steps = [
        step
        for step in steps
        if step.count >= MIN_COUNT and not any(_is_multiple(step.shift, row, layout.mate_tolerance) for row in rows)
    ]
    steps.sort(key=lambda step: (-step.parts, *step.shift.tolist()))
    return steps[:MAX_BAYS]


def _is_multiple(shift: FloatArray, other: FloatArray, tolerance: float) -> bool:
    """Return whether a shift is another one several times; `tolerance` for each of these."""
    times = round(float(np.linalg.norm(shift)) / float(np.linalg.norm(other)))
    return times > 1 and float(np.linalg.norm(shift - times * other)) <= times * tolerance


def bay_ends(layout: Layout, shift: FloatArray) -> BoolArray:
    """Return which parts may be at the ends of a bay, such as legs: they are nearly as large as the shape across it."""
    sides = (layout.boxes[:, 1] - layout.boxes[:, 0]) / np.maximum(layout.extent, 1e-12)
    ends: BoolArray = np.count_nonzero(sides[:, shift == 0] >= MIN_END_SHARE, axis=1) > 0
    return ends


def _share(layout: Layout, shift: FloatArray) -> float:
    """Return the length of a step as a share of the box along its largest component."""
    axis = int(np.abs(shift).argmax())
    return float(np.abs(shift[axis]) / max(layout.extent[axis], 1e-12))


def _without_multiples(layout: Layout, steps: list[Step]) -> list[Step]:
    """Return the steps without multiples of another one that all their parts take too.

    What a multiple would leave out, since it lacks a part so far away, would be missing in the middle of a row.
    """
    taking = [(layout.mates(step.shift) >= 0) | (layout.mates(-step.shift) >= 0) for step in steps]
    kept = []
    for step, parts in zip(steps, taking, strict=True):
        multiple_of = (
            not (parts & ~other_parts).any() and _is_multiple(step.shift, other.shift, layout.mate_tolerance)
            for other, other_parts in zip(steps, taking, strict=True)
        )
        if not any(multiple_of):
            kept.append(step)
    return kept


def _shifts(layout: Layout, max_share: float = MAX_STEP_SHARE) -> FloatArray:
    """Return the differences of the anchors of parts of one class, float64 (k, 3), of usable lengths.

    max_share: longest of them, as a share of the box along its direction
    """
    from scipy.spatial import cKDTree

    found = [np.empty((0, 3))]
    for kind in np.flatnonzero(np.bincount(layout.classes) > 1).tolist():
        anchors = layout.anchors[layout.classes == kind]
        count = min(len(anchors), MAX_NEIGHBOURS_PER_PART + 1)
        _, near = cKDTree(anchors).query(anchors, k=count)
        found.append((anchors[near[:, 1:]] - anchors[:, None]).reshape(-1, 3))
    shifts = np.concatenate(found)
    lengths = np.linalg.norm(shifts, axis=1)
    shifts = np.where(np.abs(shifts) <= np.minimum(MAX_SKEW * lengths, layout.mate_tolerance)[:, None], 0.0, shifts)
    largest = np.abs(shifts).argmax(axis=1)
    is_positive = shifts[np.arange(len(shifts)), largest] > 0
    shares = np.abs(shifts) / np.maximum(layout.extent, 1e-12)
    is_short = np.take_along_axis(shares, largest[:, None], axis=1)[:, 0] <= max_share
    usable: FloatArray = shifts[is_positive & is_short & (lengths > MIN_STEP_TOLERANCES * layout.mate_tolerance)]
    return usable


def distinct_values(values: FloatArray, gap: float) -> list[float]:
    """Return values in ascending order, without those that follow another by at most a gap."""
    kept: list[float] = []
    for value in np.sort(np.round(values, ROUNDING_DECIMALS)).tolist():
        if not kept or value - kept[-1] > gap:
            kept.append(value)
    return kept
