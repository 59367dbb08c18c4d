"""Slabs: a period of rows between two parallel planes, inserted or removed.

A slab begins at `at - normal @ shift` along its normal and ends at `at`. Parts that begin in it are copied by the
shift, parts beyond it move, and parts that span it become longer or shorter. A slab is valid where each contact across
its end recurs a period earlier, so that a new seam shows only what the exemplar shows. What occurs once stays where it
is. A part that spans the slab and is neither a prism nor repeats itself is stretched, if it then touches what it has
to.

The slab of a bay is whole: what occurs once in it is copied too, such as the door between the two sides of a cabinet.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stages.rows.layout import Layout, sorted_edges, with_classes, with_translates
from stages.rows.spanning import Span
from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import PartMesh
from stages.shape.stretch import STRETCHED_DEPTH

MIN_PARALLEL_COSINE = 0.999
"""Cosine of the angle of two steps from which they are parallel."""
MAX_REACH_SHARE = 0.25
"""Maximum share of a bay by which its parts stand out of it."""
MIN_OVERHANG_SHARE = 0.5
"""Parts that reach out of a bay and are shorter than this share of it are copied with it."""
HELD_ONCE = "a part that spans the slab holds a single part of the row"
CANNOT_STRETCH = "a part that spans the slab is neither a prism there nor repeats itself, and is too short to stretch"
APART = "a stretched part is apart from what it has to touch"

END_MARGIN_SHARE = 0.1
"""Parts are at an end of a shape up to this share of its length away from it."""
MIN_FILLING_PARTS = 3
MIN_FILLED_SHARE = 0.7
"""Share of a part's length from which the row of at least MIN_FILLING_PARTS that it holds fills it."""


class SlabError(ValueError):
    """A slab that cannot be inserted or removed; the message says why."""


@dataclass(frozen=True)
class RowChange:
    """A period that is inserted or removed.

    normal: float64 (3,), of length 1
    shift: translation by one period, float64 (3,), with `normal @ shift > 0`
    at: where the slab ends along the normal
    times: number of periods inserted, or -1 for one that is removed
    is_bay: whether a period holds everything in the slab, also what occurs once
    is_mirrored: whether the ends of the bay are mirror images, or turned by 180 degrees, instead of translates
    is_modular: whether the bay is between planes that cut modules in the same way
    """

    normal: FloatArray
    shift: FloatArray
    at: float
    times: int
    is_bay: bool = False
    is_mirrored: bool = False
    is_modular: bool = False


@dataclass(frozen=True, eq=False)
class Slab:
    """The parts of a layout by where they are relative to a slab.

    mates, previous: int64 (n,), the part one step after and one step before each, or -1
    low, high: float64 (n,), where each part begins and ends along the normal
    is_bay: whether a period holds everything in the slab, also what occurs once
    """

    layout: Layout
    normal: FloatArray
    shift: FloatArray
    at: float
    mates: np.ndarray
    previous: np.ndarray
    low: FloatArray
    high: FloatArray
    is_bay: bool = False

    @property
    def start(self) -> float:
        """Where the slab begins along its normal."""
        return self.at - float(self.normal @ self.shift)

    @cached_property
    def within(self) -> BoolArray:
        """Which parts begin in the slab, bool (n,): of a bay also those that stand out, and none that overhang."""
        inside: BoolArray = (self._begins & ~self._overhangs) | self._stands_out
        return inside

    @cached_property
    def recurs(self) -> BoolArray:
        """Which parts are in the slab and have a part one step before or after; all parts in a bay."""
        recurring: BoolArray = self.within & (self._has_mate | self.is_bay)
        return recurring

    @cached_property
    def _begins(self) -> BoolArray:
        tolerance = self.layout.tolerance
        begins: BoolArray = (self.low >= self.start - tolerance) & (self.low < self.at - tolerance)
        return begins

    @cached_property
    def _has_mate(self) -> BoolArray:
        has_one: BoolArray = (self.mates >= 0) | (self.previous >= 0)
        return has_one

    @cached_property
    def reach(self) -> float:
        """How far parts of a bay may stand out of it: the thickness of the parts at its ends."""
        thickness = float((self.high - self.low)[self._begins & self._has_mate].max(initial=0.0))
        return min(thickness, MAX_REACH_SHARE * (self.at - self.start)) + self.layout.tolerance

    @cached_property
    def _fills(self) -> BoolArray:
        """Which parts occur once in a bay and reach across its end, or from its start to its end, bool (n,)."""
        if not self.is_bay:
            return np.zeros(len(self.low), dtype=bool)
        tolerance = self.layout.tolerance
        begins = (self.low >= self.start - self.reach) & (self.low < self.at - tolerance)
        is_full = (self.low <= self.start + tolerance) & (self.high >= self.at - tolerance)
        filling: BoolArray = begins & ~self._has_mate & (is_full | (self.high > self.at + tolerance))
        return filling

    @cached_property
    def _overhangs(self) -> BoolArray:
        """Which parts fill a bay and become longer with it, such as a table top: prisms between its ends, bool (n,)."""
        long = self._fills & (self.high - self.low >= MIN_OVERHANG_SHARE * (self.at - self.start))
        overhanging = np.zeros(len(self.low), dtype=bool)
        for part in np.flatnonzero(long).tolist():
            heights = self.layout.heights(part, self.normal)
            begin = max(self.start, float(self.low[part])) + self.reach
            overhanging[part] = not ((heights > begin) & (heights < self.at - 2.0 * self.layout.tolerance)).any()
        return overhanging

    @cached_property
    def _stands_out(self) -> BoolArray:
        """Which parts fill a bay and are copied with it, such as the door in front of a cabinet, bool (n,)."""
        standing_out: BoolArray = self._fills & ~self._overhangs & (self.high <= self.at + self.reach)
        return standing_out

    @cached_property
    def beyond(self) -> BoolArray:
        """Which parts begin at the end of the slab or after it."""
        behind: BoolArray = self.low >= self.at - self.layout.tolerance
        return behind

    @cached_property
    def spanning(self) -> np.ndarray:
        """Parts that begin before the slab and end after it, or overhang a bay, int64 (k,), ascending."""
        begins = self.low < self.start - self.layout.tolerance
        spans = begins & (self.high > self.at + self.layout.tolerance) & ~self._stands_out
        return np.flatnonzero(spans | self._overhangs)

    @property
    def held(self) -> dict[int, Counter[int]]:
        """The types of the recurring parts that each spanning part touches."""
        types, neighbours = self.layout.types, self.layout.neighbours
        return {
            holder: Counter(types[neighbours[holder][self.recurs[neighbours[holder]]]].tolist())
            for holder in self.spanning.tolist()
        }

    @cached_property
    def _is_spanning(self) -> BoolArray:
        """Whether each part is one of `spanning`, bool (n,)."""
        is_spanning = np.zeros(len(self.layout), dtype=bool)
        is_spanning[self.spanning] = True
        return is_spanning

    @cached_property
    def before(self) -> BoolArray:
        """Which parts begin before the slab and end before its end."""
        left: BoolArray = ~self.within & ~self.beyond
        left[self.spanning] = False
        return left

    def insertion_fault(self) -> str | None:
        """Return why periods cannot be inserted as far as contacts tell, or None."""
        within, beyond, before, recurs = self.within, self.beyond, self.before, self.recurs
        tolerance = self.layout.tolerance
        if not (recurs & self._has_mate).any():
            return "nothing recurs in the slab"
        crosses = (self.high > self.at + tolerance) & ~self._stands_out
        if (crosses & within & ~recurs).any():
            return "a part that occurs once crosses the end of the slab"
        if (crosses & recurs & (self.previous < 0)).any():
            return "no part crosses the start of the slab as one crosses its end"
        i, j = self.both_ways
        if (before[i] & beyond[j]).any():
            return "parts before and after the slab touch"
        if not self.is_bay and self._is_held_once:
            return HELD_ONCE
        across = within[i] & beyond[j]
        behind = self.previous[j[across]]
        if (~recurs[i[across]]).any() or (behind < 0).any() or not recurs[behind].all():
            return "a contact across the end of the slab does not recur at its start"
        back = recurs[i] & before[j] & ((self.mates[i] < 0) | self.is_bay)
        if not self._leads_into(j[back], recurs):
            return "a contact at the start of the slab does not recur at its end"
        into = np.where(self.mates >= 0, recurs[self.mates], False)
        lost = recurs[i] & ((within[j] & ~recurs[j]) | (before[j] & ~into[j]))
        is_missed = self._is_missed(i[lost], behind)
        return "a copy would lack what each part of its row has" if is_missed else None

    def _is_missed(self, parts: np.ndarray, gaining: np.ndarray) -> bool:
        """Return whether a copy has fewer contacts than the parts a step before and after it.

        parts: the part of each contact that its copy loses, int64 (k,)
        gaining: the part of each contact that its copy gets with the copy before, int64 (k,)
        """
        degrees = np.bincount(self.layout.edges.ravel(), minlength=len(self.layout))
        beside = np.stack([self.mates, self.previous])
        minimum = np.where(beside >= 0, degrees[beside], len(self.layout)).min(axis=0)
        lost, gained = (np.bincount(listed, minlength=len(self.layout)) for listed in (parts, gaining))
        left = degrees - lost + gained
        return bool((left[parts] < minimum[parts]).any())

    def removal_fault(self) -> str | None:
        """Return why the period cannot be removed as far as contacts tell, or None."""
        within, beyond, before, recurs = self.within, self.beyond, self.before, self.recurs
        if not recurs.any():
            return "nothing recurs in the slab"
        if (within & ~recurs).any():
            return "a part that occurs once is in the slab"
        if self.is_bay and not np.isin(self.layout.types[within], self.layout.types[~within]).all():
            return "the last part of a type would be removed"
        if not (beyond | before).any() and not len(self.spanning):
            return "nothing would be left"
        crosses = before & (self.high > self.start + self.layout.tolerance)
        if not self._leads_into(np.flatnonzero(crosses), recurs):
            return "no part crosses the end of the slab as one crosses its start"
        i, j = self.both_ways
        if (before[i] & beyond[j]).any():
            return "parts before and after the slab touch"
        if not self.is_bay and self._is_held_once:
            return HELD_ONCE
        across = within[i] & beyond[j]
        behind = self.previous[j[across]]
        if (behind < 0).any() or not within[behind].all():
            return "a contact across the end of the slab does not recur at its start"
        back = within[i] & before[j]
        if not self._leads_into(i[back], beyond):
            return "a contact at the start of the slab does not recur at its end"
        # A part beyond the slab takes the place of the one a step before, and needs as many contacts.
        degrees = np.bincount(self.layout.edges.ravel(), minlength=len(self.layout))
        gained = np.bincount(i[back], minlength=len(self.layout))
        left = degrees - np.bincount(j[across], minlength=len(self.layout))
        ends = j[across]
        if (left[ends] + gained[self.previous[ends]] < degrees[self.previous[ends]]).any():
            return "a part beyond the slab would lack what the part before it has"
        return None

    @cached_property
    def _is_held_once(self) -> bool:
        """Whether a part that spans the slab touches a recurring part, and neither the one a step before nor after it.

        It holds no row: a long drawer front has one handle, and a longer one has no two.
        """
        i, j = self.both_ways
        held = self.recurs[i] & self._is_spanning[j]
        parts, holders, count = i[held], j[held].astype(np.int64), len(self.layout)
        holds_row = np.zeros(len(parts), dtype=bool)
        for beside in (self.mates[parts], self.previous[parts]):
            holds_row |= (beside >= 0) & np.isin(beside * count + holders, self.layout.contact_keys)
        return not holds_row.all()

    def tears(self, mates: np.ndarray, times: int) -> bool:
        """Return whether a row with another step would get a gap, or a part too near, at the slab.

        mates: the part one step of that row after each, or -1, int64 (n,)
        times: 1 for insertions, -1 for a removal
        """
        first = np.flatnonzero((mates >= 0) & ~self.beyond & ~self._is_spanning)
        second = mates[first]
        if times > 0:
            first, second = first[self.beyond[second]], second[self.beyond[second]]
            replaced = self._recurs_at(self.previous[second])
            return not (replaced & (self.recurs[first] | self._recurs_at(self.mates[first]))).all()
        first, second = first[self.before[first]], second[self.before[first]]
        if self.beyond[second].any():
            return True
        removed = second[self.within[second]]
        return not self._leads_into(removed, self.beyond)

    def leaves_gap(self, members: np.ndarray) -> bool:
        """Return whether a part that another row fills would become longer where none of that row is copied.

        A ladder whose handrail gets more brackets would have no rungs there.
        members: parts of that row, int64 (k,), as of `parts_of_dense_row`
        """
        if not len(members) or not len(self.spanning) or self.recurs[members].any():
            return False
        for holder in self.spanning.tolist():
            held = np.intersect1d(members, self.layout.neighbours[holder])
            if len(held) < MIN_FILLING_PARTS:
                continue
            filled = float(self.high[held].max() - self.low[held].min())
            if filled >= MIN_FILLED_SHARE * float(self.high[holder] - self.low[holder]):
                return True
        return False

    @property
    def leaves_some_uncopied(self) -> bool:
        """Whether a part of the slab occurs once although another of its type recurs: a row would get a gap."""
        types = self.layout.types
        return bool(np.isin(types[self.within & ~self.recurs], types[self.recurs]).any())

    def leaves_end_behind(self, ends: np.ndarray) -> bool:
        """Return whether the shape would become longer beyond parts at its ends, such as beyond the legs of a table.

        ends: parts at the ends of bays along the normal, int64 (k,)
        """
        if not len(ends):
            return False
        low, high = float(self.low.min()), float(self.high.max())
        margin = END_MARGIN_SHARE * (high - low)
        last = ends[self.high[ends] >= self.high[ends].max() - self.layout.tolerance]
        if self.high[last].max() >= high - margin and not (self.beyond | self.recurs)[last].all():
            return True
        first = ends[self.low[ends] <= self.low[ends].min() + self.layout.tolerance]
        return bool(self.low[first].min() <= low + margin and self.beyond[first].any())

    def _recurs_at(self, parts: np.ndarray) -> BoolArray:
        """Return which parts exist (not -1) and recur in the slab."""
        recurring: BoolArray = (parts >= 0) & self.recurs[parts]
        return recurring

    @cached_property
    def is_regular(self) -> bool:
        """Whether no part that spans the slab has to be cut."""
        spans = [self.span(part) for part in self.spanning.tolist()]
        return all(span.recurs for span in spans) and all(span.is_regular for span in spans)

    @cached_property
    def stretches(self) -> bool:
        """Whether any spanning part has to be stretched; quick tests of all parts come before slow ones of any."""
        spans = [self.span(part) for part in self.spanning.tolist()]
        return not (all(span.recurs for span in spans) and all(span.can_change for span in spans))

    @cached_property
    def stretched(self) -> np.ndarray:
        """Spanning parts that have to be stretched, int64 (k,), ascending."""
        return np.array([part for part in self.spanning.tolist() if not self.span(part).can_change], dtype=np.int64)

    def spanning_fault(self, times: int) -> str | None:
        """Return why a part that spans the slab cannot become longer by `times` periods (-1: shorter by one), or
        None."""
        if self.is_bay and len(self.stretched):
            return CANNOT_STRETCH
        can_stretch = all(self.span(part).can_stretch(times) for part in self.stretched.tolist())
        return None if can_stretch else CANNOT_STRETCH

    @property
    def both_ways(self) -> tuple[np.ndarray, np.ndarray]:
        """Both parts of each contact, seen from each of them, int (2 m,) each."""
        edges = self.layout.edges
        return np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([edges[:, 1], edges[:, 0]])

    def _leads_into(self, parts: np.ndarray, aims: BoolArray) -> bool:
        """Return whether one step leads from each part to one of the aims."""
        mates = self.mates[parts]
        return bool((mates >= 0).all() and aims[mates].all())

    def span(self, part: int) -> Span:
        """Return a spanning part with the slab."""
        if part not in self._spans:
            self._spans[part] = self._new_span(part)
        return self._spans[part]

    @cached_property
    def _spans(self) -> dict[int, Span]:
        return {}

    def _new_span(self, part: int) -> Span:
        layout = self.layout
        points = layout.points[part]
        heights = layout.heights(part, self.normal)
        mates, previous = layout.vertex_mates(part, self.shift), layout.vertex_mates(part, -self.shift)
        start, end = self.start, self.at
        if self._overhangs[part]:  # it may end with the slab, and is a prism just before that
            start = end = self.at - 2.0 * layout.tolerance
        slab = start, end, self.shift, layout.tolerance
        return Span(layout.meshes[part], layout.poses[part], points, mates, previous, heights, *slab)


def parts_of_dense_row(layout: Layout, mates: np.ndarray, normal: FloatArray, shift: FloatArray) -> np.ndarray:
    """Return the parts of a row that is parallel to a shift, with a step of at most its length, int64 (k,); else none.

    mates: the part one step of that row after each, or -1, int64 (n,)
    """
    first = np.flatnonzero(mates >= 0)
    steps = layout.anchors[mates[first]] - layout.anchors[first]
    is_dense = len(first) and abs(float(np.median(steps @ normal))) <= float(normal @ shift)
    if not is_dense or not are_along(steps[:1], shift).all():
        return np.empty(0, dtype=np.int64)
    return np.union1d(first, mates[first])


def are_along(steps: FloatArray, shift: FloatArray) -> BoolArray:
    """Return which steps (k, 3) are parallel to a shift, bool (k,)."""
    lengths = np.linalg.norm(steps, axis=1) * float(np.linalg.norm(shift))
    parallel: BoolArray = np.abs(steps @ shift) >= MIN_PARALLEL_COSINE * lengths
    return parallel


def slab_of(layout: Layout, change: RowChange) -> Slab:
    """Return the slab of a change of a layout."""
    low, high = layout.spans(change.normal)
    mates, previous = layout.mates(change.shift), layout.mates(-change.shift)
    return Slab(layout, change.normal, change.shift, change.at, mates, previous, low, high, change.is_bay)


def repeat(layout: Layout, change: RowChange) -> Layout:
    """Return a layout in which periods are inserted or one is removed. Raises SlabError where that is not valid."""
    slab = slab_of(layout, change)
    fault = slab.insertion_fault() if change.times > 0 else slab.removal_fault()
    fault = fault or slab.spanning_fault(change.times)
    if fault is not None:
        raise SlabError(fault)
    made = inserted(slab, change.times) if change.times > 0 else removed(slab)
    kept = np.flatnonzero(~slab.within) if change.times < 0 else np.arange(len(layout))
    if not touch_all(made, np.searchsorted(kept, slab.stretched)):
        raise SlabError(APART)
    return made


def touch_all(layout: Layout, parts: np.ndarray) -> bool:
    """Return whether parts int64 (k,) touch all that they have a contact with, up to STRETCHED_DEPTH."""
    if not len(parts):
        return True
    from stages.shape.geometry.contact import ContactTest

    edges = layout.edges[np.isin(layout.edges, parts).any(axis=1)]
    involved = np.unique(edges)
    meshes = [layout.meshes[part] for part in involved.tolist()]
    test = ContactTest(meshes, layout.tolerance)
    poses = relative_poses(layout.poses, edges)
    return all(
        test.touches(i, j, pose, layout.tolerance + STRETCHED_DEPTH * min(meshes[i].diagonal, meshes[j].diagonal))
        for (i, j), pose in zip(np.searchsorted(involved, edges).tolist(), poses, strict=True)
    )


def inserted(slab: Slab, times: int) -> Layout:
    """Return the layout with `times` more copies of a valid slab, after its own parts."""
    layout = slab.layout
    copied = np.flatnonzero(slab.recurs)
    index_of = np.full(len(layout), -1, dtype=np.int64)
    index_of[copied] = np.arange(len(copied))

    def copy(part: int, number: int) -> int:
        return part if number == 0 else len(layout) + (number - 1) * len(copied) + int(index_of[part])

    edges: list[tuple[int, int]] = []
    for i, j in layout.edges.tolist():
        for part, other in ((i, j), (j, i)):
            if slab.recurs[part] and slab.beyond[other]:
                behind = int(slab.previous[other])
                edges += [(copy(part, number), copy(behind, number + 1)) for number in range(times)]
                edges.append((copy(part, times), other))
                break
            if slab.recurs[part] and slab.before[other]:
                into = int(slab.mates[other])
                edges.append((part, other))
                if into >= 0 and slab.recurs[into]:
                    edges += [(copy(into, number), copy(part, number + 1)) for number in range(times)]
                break
            if slab.recurs[part] and not slab.recurs[other] and not slab.within[other]:  # it spans the slab
                edges += [(copy(part, number), other) for number in range(times + 1)]
                break
        else:
            edges.append((i, j))
            if slab.recurs[i] and slab.recurs[j]:
                edges += [(copy(i, number), copy(j, number)) for number in range(1, times + 1)]
    return with_copies(slab, copied, times, sorted_edges(edges))


def with_copies(slab: Slab, copied: np.ndarray, times: int, edges: IntArray) -> Layout:
    """Return the layout with `times` copies of some parts of a slab, after its own parts, and with these contacts.

    copied: int64 (k,), ascending
    """
    layout = slab.layout
    meshes, poses = _moved(slab, times)
    moved = with_classes(replace(layout, meshes=tuple(meshes), poses=poses), _class_keys(slab, times))
    return replace(with_translates(moved, copied, layout.poses[copied], slab.shift, times), edges=edges)


def removed(slab: Slab) -> Layout:
    """Return the layout without the parts of a valid slab, those beyond it one step nearer."""
    edges = [(i, j) for i, j in slab.layout.edges.tolist() if not (slab.within[i] or slab.within[j])]
    for i, j in slab.layout.edges.tolist():
        for part, other in ((i, j), (j, i)):
            if slab.within[part] and slab.before[other]:
                edges.append((int(slab.mates[part]), other))
    return without(slab, edges)


def without(slab: Slab, edges: Sequence[tuple[int, int]]) -> Layout:
    """Return the layout without the parts of a slab, and with these contacts of the other parts."""
    layout = slab.layout
    meshes, poses = _moved(slab, -1)
    kept = np.flatnonzero(~slab.within)
    index_of = np.full(len(layout), -1, dtype=np.int64)
    index_of[kept] = np.arange(len(kept))
    shorter = replace(
        layout,
        meshes=tuple(meshes[part] for part in kept.tolist()),
        poses=poses[kept],
        types=layout.types[kept],
        origins=layout.origins[kept],
        edges=sorted_edges([(int(index_of[i]), int(index_of[j])) for i, j in edges]),
    )
    keys = _class_keys(slab, -1)
    return with_classes(shorter, [keys[part] for part in kept.tolist()])


def _moved(slab: Slab, times: int) -> tuple[list[PartMesh], FloatArray]:
    """Return surface and pose of each part: those beyond the slab are moved, those that span it changed."""
    meshes, poses = list(slab.layout.meshes), slab.layout.poses.copy()
    poses[slab.beyond, :3, 3] += times * slab.shift
    for part in slab.spanning.tolist():
        meshes[part], poses[part] = slab.span(part).changed(times)
    return meshes, poses


def _class_keys(slab: Slab, times: int) -> list[tuple[int, ...]]:
    """Return for each part what it has in common with parts that are translates of it after the change.

    Spanning parts of one class stay translates if they begin at the same height.
    """
    keys: list[tuple[int, ...]] = [(kind, 0, 0) for kind in slab.layout.classes.tolist()]
    for part in slab.spanning.tolist():
        keys[part] = keys[part][0], times, round(float(slab.low[part]) / slab.layout.mate_tolerance)
    return keys
