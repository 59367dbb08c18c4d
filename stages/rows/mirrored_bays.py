"""Bays between mirrored ends: a table gets a middle frame, a railing another panel, a window another pair of leaves.

The ends are mirror images of each other about the middle of the shape, or are turned by 180 degrees, so that no
translation leads from one to the other. A bay is everything from one end up to the other, and is inserted again. If
nothing separates the two ends from each other, they are inserted as a pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.rows.layout import VERTEX_REACH, Layout, sorted_edges
from stages.rows.seams import kept_contacts, with_seams
from stages.rows.slabs import APART, RowChange, Slab, SlabError, touch_all, with_copies
from stages.rows.steps import MIN_END_SHARE, ROUNDING_DECIMALS, distinct_values

MIRRORED_ENDS = 2
"""Ends of a shape between which bays are inserted; they count as a row of two parts."""
MIN_BAY_SHARE = 0.2
"""Shortest bay, as a share of the box along its axis."""
MAX_END_SHARE = 0.35
"""Thickest end of a shape that is inserted alone, as a share of the box along its axis."""
MIN_MIRRORED_SHARE = 0.97
"""Share of the vertices of a part that have to be mirrored onto vertices of its twin."""
MAX_AREA_DIFFERENCE = 0.02
"""Largest relative difference of the areas of twins."""
MAX_BAYS_PER_AXIS = 2
"""Bays that are kept along one axis, the outermost first."""


@dataclass(frozen=True)
class MirroredBay:
    """A bay that can be inserted.

    axis: index of the axis along which the shape becomes longer
    start, end: where the bay begins and ends along it, in the kit's units
    ends: parts at the lower end of the shape that have a twin at its upper end, int64 (k,)
    """

    axis: int
    start: float
    end: float
    ends: np.ndarray

    def insertion(self, times: int) -> RowChange:
        """Return the insertion of `times` more bays."""
        normal = np.eye(3)[self.axis]
        shift = np.round(self.end - self.start, ROUNDING_DECIMALS) * normal
        return RowChange(normal, shift, self.end, times, is_bay=True, is_mirrored=True)


def find_mirrored_bays(layout: Layout, up: int) -> list[MirroredBay]:
    """Return the bays between mirrored ends of a layout, along axes other than `up`.

    Where no part spans a bay, it is inserted along the longest of these alone: a sofa gets longer, a bus no wider. Then
    the types of the parts at its ends must occur nowhere else.
    """
    found: list[MirroredBay] = []
    axes = [axis for axis in range(3) if axis != up]
    longest = max(axes, key=lambda axis: float(layout.extent[axis]))
    for axis in axes:
        found += _bays_along(layout, axis, axis == longest)
    return found


def with_mirrored_bays(layout: Layout, change: RowChange) -> Layout:
    """Return a layout with more bays between mirrored ends. Raises SlabError where that is not valid."""
    axis = int(np.abs(change.normal).argmax())
    if change.times < 1 or not np.array_equal(change.normal, np.eye(3)[axis]) or np.count_nonzero(change.shift) != 1:
        raise SlabError("a bay between mirrored ends is inserted along an axis")
    end, start = change.at, change.at - float(change.shift[axis])
    twins = _twins(layout, axis)
    slab = _slab(layout, twins, axis, start, end)
    ends = _ends(slab, twins)
    if not len(ends) or abs(float(slab.low[ends].min()) - start) > 2.0 * layout.tolerance:
        raise SlabError("no mirrored ends begin there")
    last = 2.0 * _middle(layout, axis) - end
    if (slab.mates >= 0).any() and abs(float(slab.high[ends].max()) - last) > 2.0 * layout.tolerance:
        raise SlabError("no mirrored ends end there")
    return _inserted(slab, change.times)


def _bays_along(layout: Layout, axis: int, is_longest: bool) -> list[MirroredBay]:
    """Return the bays along an axis, the outermost first."""
    twins = _twins(layout, axis)
    lower = np.flatnonzero(twins >= 0)
    if not len(lower):
        return []
    low, high = layout.boxes[:, 0, axis], layout.boxes[:, 1, axis]
    middle, length = _middle(layout, axis), float(layout.extent[axis])
    found: list[MirroredBay] = []
    for start in distinct_values(low[lower], 2.0 * layout.tolerance):
        inner = lower[low[lower] >= start - layout.tolerance]
        thin = high[inner][high[inner] <= start + MAX_END_SHARE * length]
        ends = [2.0 * middle - last for last in distinct_values(thin, 2.0 * layout.tolerance)]
        for end in (*ends, 2.0 * middle - start):
            bay = _bay(layout, twins, axis, start, round(end, ROUNDING_DECIMALS), is_longest)
            if bay is not None:
                found.append(bay)
                break
        if len(found) == MAX_BAYS_PER_AXIS:
            break
    return found


def _bay(
    layout: Layout, twins: np.ndarray, axis: int, start: float, end: float, is_longest: bool
) -> MirroredBay | None:
    """Return a bay if it can be inserted, and its ends are neither translates nor small."""
    if end - start < MIN_BAY_SHARE * float(layout.extent[axis]):
        return None
    slab = _slab(layout, twins, axis, start, end)
    ends, is_pair = _ends(slab, twins), not (slab.mates >= 0).any()
    if not len(ends):
        return None
    if not len(slab.spanning) and (is_pair or not is_longest or not _occur_at_ends_alone(layout, ends, twins)):
        return None
    ways = layout.anchors[twins[ends]] - layout.anchors[ends] if is_pair else np.tile(slab.shift, (len(ends), 1))
    if all(layout.mates(way)[part] == twins[part] for part, way in zip(ends.tolist(), ways, strict=True)):
        return None
    across = np.delete(layout.boxes[ends, 1].max(axis=0) - layout.boxes[ends, 0].min(axis=0), axis)
    if (across < MIN_END_SHARE * np.delete(layout.extent, axis)).all():
        return None
    try:
        _inserted(slab, 1)
    except SlabError:
        return None
    return MirroredBay(axis, start, end, ends)


def _occur_at_ends_alone(layout: Layout, ends: np.ndarray, twins: np.ndarray) -> bool:
    """Return whether the types of parts at the ends of a shape occur nowhere else in it.

    Arms of a sofa do. The tiles at the end of a closed road do not, and lead nowhere in its middle.
    """
    both = np.concatenate([ends, twins[ends]])
    return not np.isin(np.delete(layout.types, both), layout.types[both]).any()


def _ends(slab: Slab, twins: np.ndarray) -> np.ndarray:
    """Return the parts of a bay at the lower end of the shape, or of a pair its lower half, int64 (k,)."""
    alone = np.flatnonzero(slab.mates >= 0)
    return alone if len(alone) else np.flatnonzero((twins >= 0) & slab.within)


def _slab(layout: Layout, twins: np.ndarray, axis: int, start: float, end: float) -> Slab:
    """Return the slab of a bay. Its `mates` are the twins of the parts at the end of the shape, unless it holds both.

    start, end: where the bay begins and ends along the axis
    """
    low, high = layout.boxes[:, 0, axis], layout.boxes[:, 1, axis]
    last = 2.0 * _middle(layout, axis) - end  # where the lower end of the shape ends
    ends = np.flatnonzero((twins >= 0) & (low >= start - layout.tolerance) & (high <= last + layout.tolerance))
    mates, previous = np.full(len(layout), -1, dtype=np.int64), np.full(len(layout), -1, dtype=np.int64)
    mates[ends], previous[twins[ends]] = twins[ends], ends
    normal = np.eye(3)[axis]
    return Slab(layout, normal, (end - start) * normal, end, mates, previous, low, high, is_bay=True)


def _inserted(slab: Slab, times: int) -> Layout:
    """Return the layout with more bays. Raises SlabError where parts would be cut, lose their hold or clash."""
    layout, within, beyond, before = slab.layout, slab.within, slab.beyond, slab.before
    i, j = slab.both_ways
    if not within.any():
        raise SlabError("the bay is empty")
    if (before[i] & beyond[j]).any():
        raise SlabError("parts before and after the bay touch")
    if (within & (slab.high > slab.at + slab.reach)).any() or (
        before & (slab.high > slab.start + layout.tolerance)
    ).any():
        raise SlabError("a part crosses an end of the bay")
    if (within & (slab.high - slab.low > slab.at - slab.start + layout.tolerance)).any():
        raise SlabError("a part is longer than the bay that it is copied with")
    if len(slab.stretched):
        raise SlabError("a part that spans the bay is neither a prism there nor repeats itself")
    copied = np.flatnonzero(within)
    made = with_copies(slab, copied, times, sorted_edges(list(kept_contacts(slab, copied, times))))
    number = np.concatenate([np.where(within, 0, -1), np.repeat(np.arange(1, times + 1), len(copied))])
    made = with_seams(made, number)
    degrees = np.bincount(made.edges.ravel(), minlength=len(made))
    if (degrees[number >= 0] == 0).any() or made.pieces().max() > layout.pieces().max():
        raise SlabError("a part of the bay would be held by nothing")
    if not touch_all(made, np.arange(len(made))):
        raise SlabError(APART)
    return made


def _twins(layout: Layout, axis: int) -> np.ndarray:
    """Return for each part of the lower half of a layout its mirror image in the upper half, or -1, int64 (n,).

    A twin is mirrored about the middle of the box along the axis, or turned by 180 degrees about another axis there.
    """
    twins = np.full(len(layout), -1, dtype=np.int64)
    for axes in ([axis], *([axis, other] for other in range(3) if other != axis)):
        _add_twins(layout, axis, axes, twins)
    return twins


def _add_twins(layout: Layout, axis: int, axes: Sequence[int], twins: np.ndarray) -> None:
    """Add the twins that are mirrored along some axes. twins: int64 (n,), changed in place."""
    from scipy.spatial import cKDTree

    reach = VERTEX_REACH * layout.tolerance
    doubled = layout.boxes[:, 0].min(axis=0) + layout.boxes[:, 1].max(axis=0)
    mirrored = layout.boxes.copy()
    mirrored[:, :, axes] = doubled[axes] - layout.boxes[:, ::-1][:, :, axes]
    for part in np.flatnonzero((twins < 0) & (layout.boxes[:, 1, axis] <= doubled[axis] / 2 + reach)).tolist():
        is_near = (np.abs(layout.boxes - mirrored[part]) <= reach).all(axis=(1, 2))
        is_near &= np.abs(layout.areas - layout.areas[part]) <= MAX_AREA_DIFFERENCE * layout.areas[part]
        points = layout.points[part].copy()
        points[:, axes] = doubled[axes] - points[:, axes]
        for other in np.flatnonzero(is_near).tolist():
            gaps, _ = cKDTree(layout.points[other]).query(points)
            if other != part and (gaps <= reach).mean() >= MIN_MIRRORED_SHARE:
                twins[part] = other
                break


def _middle(layout: Layout, axis: int) -> float:
    """Return the middle of the box around a layout along an axis."""
    return float(layout.boxes[:, 0, axis].min() + layout.boxes[:, 1, axis].max()) / 2
