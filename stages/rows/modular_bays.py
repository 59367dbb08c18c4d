"""Bays of modules: a storey of a tower, a stretch of a house with its windows, a row of shelves in a store room.

Modules are parts with boxes of one size, which take each other's places: walls with and without windows. Where two
planes, one step of modules apart, cut a shape in the same way, everything between them can be inserted again, or
removed, whatever modules it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.rows.layout import Layout, sorted_edges
from stages.rows.seams import kept_contacts, with_seams
from stages.rows.slabs import APART, RowChange, Slab, SlabError, touch_all, with_copies, without
from stages.rows.steps import MAX_STEP_SHARE, MIN_STEP_TOLERANCES, ROUNDING_DECIMALS, distinct_values, longest_row
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import relative_poses

SECTION_CELLS = 64
"""Cells along each side of the section of a shape with a plane."""
CELL_ROUNDING = 1e-6
"""Part of a cell that rounding may add or take away."""
MIN_EQUAL_SECTION = 0.9
"""Share of the cells of either of two sections that both fill, from which they are equal."""
MAX_UNMATCHED_SECTION = 0.1
"""Share of a section that may be of parts that no module stands in for at the other end of the bay."""
MAX_DEGREE_RATIO = 1.25
"""Ratio up to which a part may touch more others than any part of its size, or fewer."""
MIN_BAY_AREA_SHARE = 0.005
"""Share of a shape's surface from which what a bay holds can be seen."""
MAX_STEPS_PER_AXIS = 6
MAX_PLANES = 160
"""Ends of bays that are tried for each step."""
MAX_BAYS_PER_STEP = 6
"""Bays that are tried for each step, at evenly spread places."""


@dataclass(frozen=True)
class ModularBay:
    """A bay that can be inserted or removed.

    axis: index of the axis along which the shape becomes longer or shorter
    start, end: where the bay begins and ends along it, in the kit's units
    count: modules of the longest row with the bay's length as step
    parts: the parts of the layout that the bay holds, int64 (k,)
    may_insert, may_remove: whether the bay can be inserted again, and whether it can be removed
    """

    axis: int
    start: float
    end: float
    count: int
    parts: np.ndarray
    may_insert: bool
    may_remove: bool

    def change(self, times: int) -> RowChange | None:
        """Return the insertion of `times` more bays, the removal of this one if negative, or None if not valid."""
        if not (self.may_insert if times > 0 else self.may_remove and times < 0):
            return None
        normal = np.eye(3)[self.axis]
        shift = np.round(self.end - self.start, ROUNDING_DECIMALS) * normal
        return RowChange(normal, shift, self.end, max(times, -1), is_bay=True, is_modular=True)


def find_modular_bays(layout: Layout, axes: Collection[int] = range(3)) -> list[ModularBay]:
    """Return the bays of modules of a layout along some axes, by axis, the steps that most modules take first."""
    modules = _modules(layout)
    return [bay for axis in sorted(axes) for bay in _bays_along(layout, modules, axis)]


def with_modular_bays(layout: Layout, change: RowChange) -> Layout:
    """Return a layout with more bays of modules, or with one less. Raises SlabError where that is not valid."""
    axis = int(np.abs(change.normal).argmax())
    if not np.array_equal(change.normal, np.eye(3)[axis]) or np.count_nonzero(change.shift) != 1:
        raise SlabError("a bay of modules is inserted along an axis")
    slab = _slab(layout, _modules(layout), axis, float(change.shift[axis]), change.at)
    fault = _fault(slab, _Sections(layout, axis))
    if fault is not None:
        raise SlabError(fault)
    return _inserted(slab, change.times) if change.times > 0 else _removed(slab)


@dataclass(frozen=True, eq=False)
class _Modules(Layout):
    """A layout whose classes are the sizes of boxes, and whose parts are where the middles of these are."""

    @cached_property
    def anchors(self) -> FloatArray:
        middles: FloatArray = self.boxes.mean(axis=1)
        return middles


def _modules(layout: Layout) -> _Modules:
    fields = {name: getattr(layout, name) for name in Layout.__dataclass_fields__}
    return _Modules(**{**fields, "classes": _sizes(layout)})


def _sizes(layout: Layout) -> np.ndarray:
    """Return a number for each part, equal where the boxes of parts have equal sides, int64 (n,)."""
    sides = layout.boxes[:, 1] - layout.boxes[:, 0]
    numbers = np.full(len(layout), -1, dtype=np.int64)
    for part in range(len(layout)):
        if numbers[part] < 0:
            numbers[(numbers < 0) & (np.abs(sides - sides[part]).max(axis=1) <= 2.0 * layout.mate_tolerance)] = part
    return numbers


class _Sections:
    """What planes across an axis cut, or where parts begin or end at them, as cells that are filled."""

    def __init__(self, layout: Layout, axis: int) -> None:
        self._layout, self._axis = layout, axis
        self._across = [other for other in range(3) if other != axis]
        self._low, self._high = layout.boxes[:, 0, axis], layout.boxes[:, 1, axis]
        self._tolerance = 2.0 * layout.tolerance
        self._known: dict[tuple[float, bool], BoolArray] = {}

    def are_equal(self, first: float, second: float) -> bool:
        """Return whether what ends at two planes or crosses them is the same, and also what begins there."""
        for is_after in (False, True):
            one, other = self._filled(first, is_after), self._filled(second, is_after)
            if (one & other).sum() < MIN_EQUAL_SECTION * max(int((one | other).sum()), 1):
                return False
        return True

    def share_of(self, parts: BoolArray, at: float) -> float:
        """Return what share of a section is of some of the parts that cross the plane."""
        crossing = self._cells(np.flatnonzero(parts & self._crosses(at)), at)
        return float(crossing.sum()) / max(int((crossing | self._filled(at, False)).sum()), 1)

    def _crosses(self, at: float) -> BoolArray:
        crosses: BoolArray = (self._low < at - self._tolerance) & (self._high > at + self._tolerance)
        return crosses

    def _filled(self, at: float, is_after: bool) -> BoolArray:
        """Return the cells of what crosses a plane, and begins or ends at it, bool (SECTION_CELLS, SECTION_CELLS)."""
        key = round(at, ROUNDING_DECIMALS), is_after
        if key not in self._known:
            edge = self._low if is_after else self._high
            parts = np.flatnonzero(self._crosses(at) | (np.abs(edge - at) <= self._tolerance))
            self._known[key] = self._cells(parts, at)
        return self._known[key]

    def _cells(self, parts: np.ndarray, at: float) -> BoolArray:
        """Return the cells in the boxes around the parts' sections, bool (SECTION_CELLS, SECTION_CELLS)."""
        low = self._layout.boxes[:, 0].min(axis=0)[self._across]
        cells = SECTION_CELLS / np.maximum(self._layout.extent[self._across], 1e-12)
        filled: BoolArray = np.zeros((SECTION_CELLS, SECTION_CELLS), dtype=bool)
        for part in parts.tolist():
            points = (self._cut(part, at) - low) * cells
            if not len(points):  # the part is in several pieces, and the plane passes between them
                continue
            i, j = np.floor(points.min(axis=0) + CELL_ROUNDING).astype(np.int64).clip(0, SECTION_CELLS - 1).tolist()
            k, m = np.ceil(points.max(axis=0) - CELL_ROUNDING).astype(np.int64).tolist()
            filled[i : max(k, i + 1), j : max(m, j + 1)] = True
        return filled

    def _cut(self, part: int, at: float) -> FloatArray:
        """Return where edges of a part cross a plane, and its vertices there, float64 (k, 2)."""
        points, faces = self._layout.points[part], self._layout.meshes[part].faces
        heights = points[:, self._axis] - at
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        ends = heights[edges]
        first, second = edges[ends[:, 0] * ends[:, 1] < 0].T
        shares = (heights[first] / (heights[first] - heights[second]))[:, None]
        flat = points[:, self._across]
        return np.concatenate(
            [flat[np.abs(heights) <= self._tolerance], flat[first] + shares * (flat[second] - flat[first])]
        )


def _bays_along(layout: Layout, modules: _Modules, axis: int) -> Iterator[ModularBay]:
    """Yield the bays along an axis, of each length those with the fewest parts whose type occurs once, as a door's."""
    sections = _Sections(layout, axis)
    low = float(layout.boxes[:, 0, axis].min()) - layout.tolerance
    for length in _steps(modules, axis):
        count = longest_row(modules.mates(length * np.eye(3)[axis]))
        if count < 2:
            continue
        slabs: dict[bytes, Slab] = {}
        for end in _planes(modules, axis, length):
            if end - length >= low and sections.are_equal(end - length, end):
                slab = _slab(layout, modules, axis, length, end)
                if _fault(slab, sections) is None:
                    slabs.setdefault(slab.within.tobytes(), slab)
        least = min((_unique_parts(slab) for slab in slabs.values()), default=0)
        kept = [slab for slab in slabs.values() if _unique_parts(slab) == least]
        tried = np.unique(np.linspace(0, len(kept) - 1, min(len(kept), MAX_BAYS_PER_STEP)).astype(np.int64))
        for slab in [kept[index] for index in tried.tolist()]:
            may_insert, may_remove = _is_valid(_inserted, slab), _is_valid(_removed, slab)
            if may_insert or may_remove:
                parts = np.flatnonzero(slab.within)
                yield ModularBay(axis, slab.start, slab.at, count, parts, may_insert, may_remove)


def _planes(modules: _Modules, axis: int, length: float) -> list[float]:
    """Return where parts begin or end, ascending: of many parts at most MAX_PLANES planes, of modules a step apart."""
    planes = distinct_values(modules.boxes[:, :, axis].ravel(), 2.0 * modules.tolerance)
    if len(planes) <= MAX_PLANES:
        return planes
    shift = length * np.eye(3)[axis]
    recurs = (modules.mates(shift) >= 0) | (modules.mates(-shift) >= 0)
    planes = distinct_values(modules.boxes[recurs][:, :, axis].ravel(), 2.0 * modules.tolerance)
    chosen = np.unique(np.linspace(0, len(planes) - 1, min(len(planes), MAX_PLANES)).astype(np.int64))
    return [planes[index] for index in chosen.tolist()]


def _unique_parts(slab: Slab) -> int:
    """Return how many parts of a bay are the only ones of their type."""
    types = slab.layout.types
    return int((np.bincount(types)[types[slab.within]] == 1).sum())


def _steps(modules: _Modules, axis: int) -> list[float]:
    """Return distances along an axis of modules of one size, those of most pairs first."""
    from scipy.spatial import cKDTree

    across = [other for other in range(3) if other != axis]
    longest, tolerance = MAX_STEP_SHARE * float(modules.extent[axis]), modules.mate_tolerance
    lengths: list[FloatArray] = [np.empty(0)]
    for size in np.unique(modules.classes).tolist():
        places = modules.anchors[modules.classes == size]
        pairs = cKDTree(places[:, across]).query_pairs(tolerance, p=np.inf, output_type="ndarray")
        gaps = np.abs(places[pairs[:, 0], axis] - places[pairs[:, 1], axis])
        lengths.append(gaps[gaps > MIN_STEP_TOLERANCES * tolerance])
    sorted_lengths = np.sort(np.concatenate(lengths))
    groups = np.split(sorted_lengths, np.flatnonzero(np.diff(sorted_lengths) > tolerance) + 1)
    usable = [(len(group), float(np.median(group))) for group in groups if len(group) and np.median(group) <= longest]
    usable.sort(key=lambda counted: (-counted[0], counted[1]))
    return [round(length, ROUNDING_DECIMALS) for _, length in usable[:MAX_STEPS_PER_AXIS]]


def _slab(layout: Layout, modules: _Modules, axis: int, length: float, end: float) -> Slab:
    """Return the slab of a bay. Its `mates` are modules that take each other's places."""
    normal = np.eye(3)[axis]
    shift = length * normal
    low, high = layout.boxes[:, 0, axis], layout.boxes[:, 1, axis]
    return Slab(layout, normal, shift, end, modules.mates(shift), modules.mates(-shift), low, high)


def _fault(slab: Slab, sections: _Sections) -> str | None:
    """Return why a slab is no bay of modules, or None."""
    within, before, tolerance = slab.within, slab.before, slab.layout.tolerance
    length = slab.at - slab.start
    if float(slab.layout.areas[within].sum()) < MIN_BAY_AREA_SHARE * float(slab.layout.areas.sum()):
        return "the bay holds next to nothing"
    if not sections.are_equal(slab.start, slab.at):
        return "the shape is not cut in the same way at both ends of the bay"
    if (within & (slab.high - slab.low > length + tolerance)).any():
        return "a part is longer than the bay that it is copied with"
    unmatched = (within & (slab.previous < 0), slab.at), (before & (slab.mates < 0), slab.start)
    if any(sections.share_of(parts, at) > MAX_UNMATCHED_SECTION for parts, at in unmatched):
        return "parts that no module stands in for cross an end of the bay"
    i, j = slab.both_ways
    if (before[i] & slab.beyond[j]).any():
        return "parts before and after the bay touch"
    if len(slab.stretched):
        return "a part that spans the bay is neither a prism there nor repeats itself"
    return None


def _is_valid(make: Callable[[Slab], Layout], slab: Slab) -> bool:
    try:
        make(slab)
    except SlabError:
        return False
    return True


def _inserted(slab: Slab, times: int = 1) -> Layout:
    """Return the layout with more bays. Raises SlabError where parts would lose their hold or clash."""
    copied = np.flatnonzero(slab.within)
    made = with_copies(slab, copied, times, sorted_edges(list(kept_contacts(slab, copied, times))))
    number = np.concatenate([np.where(slab.within, 0, -1), np.repeat(np.arange(1, times + 1), len(copied))])
    return _joined(slab, made, number, slab.spanning)


def _removed(slab: Slab) -> Layout:
    """Return the layout without the bay. Raises SlabError where parts would lose their hold or clash."""
    types, kept = slab.layout.types, ~slab.within
    if not np.isin(types[~kept], types[kept]).all():
        raise SlabError("the last part of a type would be removed")
    made = without(slab, [(i, j) for i, j in slab.layout.edges.tolist() if kept[i] and kept[j]])
    number = np.where(slab.beyond, 1, np.where(slab.before, 0, -1))[kept]
    return _joined(slab, made, number, np.searchsorted(np.flatnonzero(kept), slab.spanning))


def _joined(slab: Slab, made: Layout, number: np.ndarray, spanning: np.ndarray) -> Layout:
    """Return a layout with the contacts across its seams. number: as of `with_seams`; spanning: int64 (k,)"""
    joined = with_seams(made, number, _Overlaps(made).deepest)
    if not _have_usual_degrees(slab.layout, joined):
        raise SlabError("a part would touch far more or far fewer others than parts of its size do")
    if joined.pieces().max() > slab.layout.pieces().max():
        raise SlabError("the shape would fall apart")
    if not touch_all(joined, spanning):
        raise SlabError(APART)
    return joined


def _have_usual_degrees(layout: Layout, made: Layout) -> bool:
    """Return whether no part touches far more or far fewer others than the parts of a layout do that have its size.

    The corners of a closed road do not become crossings, and no road ends where another tile led on.
    """
    sizes = _sizes(layout)
    degrees, new_degrees = (np.bincount(shape.edges.ravel(), minlength=len(shape)) for shape in (layout, made))
    least, most = np.full(len(layout), len(made)), np.zeros(len(layout), dtype=np.int64)
    np.minimum.at(least, sizes, degrees)
    np.maximum.at(most, sizes, degrees)
    index_of = np.zeros(int(layout.origins.max()) + 1, dtype=np.int64)
    index_of[layout.origins] = np.arange(len(layout))
    own = sizes[index_of[made.origins]]
    is_usual = (MAX_DEGREE_RATIO * new_degrees >= least[own]) & (new_degrees <= MAX_DEGREE_RATIO * most[own])
    return bool(is_usual.all())


class _Overlaps:
    """How deep modules overlap where they touch, by their sizes: those at a corner of two walls do."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._depths: dict[tuple[int, int], float] = {}

    def deepest(self, first: int, second: int) -> float:
        """Return the deepest overlap of two parts in contact that have the sizes of these two, in units."""
        low, high = sorted((int(self._sizes[first]), int(self._sizes[second])))
        if (low, high) not in self._depths:
            self._depths[low, high] = self._measured(low, high)
        return self._depths[low, high]

    @cached_property
    def _sizes(self) -> np.ndarray:
        return _sizes(self._layout)

    def _measured(self, low: int, high: int) -> float:
        from stages.shape.geometry.penetration import PenetrationTest, depth_bound

        layout = self._layout
        pairs = layout.edges[(np.sort(self._sizes[layout.edges], axis=1) == (low, high)).all(axis=1)]
        test, deepest = PenetrationTest(layout.meshes), 0.0
        measured = set[tuple[int, int, bytes]]()
        for (i, j), pose in zip(pairs.tolist(), relative_poses(layout.poses, pairs), strict=True):
            key = id(layout.meshes[i]), id(layout.meshes[j]), np.rint(pose / layout.mate_tolerance).tobytes()
            if key not in measured and depth_bound(layout.boxes[i], layout.boxes[j]) > deepest:
                measured.add(key)
                deepest = max(deepest, test.depth(i, j, pose))
        return deepest
