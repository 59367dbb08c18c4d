"""Rows of a layout, and the changes of their lengths that are valid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from stages.rows.layout import Layout
from stages.rows.slabs import RowChange, Slab, SlabError, parts_of_dense_row, repeat
from stages.rows.steps import ROUNDING_DECIMALS, Step, bay_ends, longest_row, steps_of, with_long_rows
from stages.shape.arrays import BoolArray, FloatArray

MIN_ROW = 2
MIN_TORN_ROW = 3
"""Parts of a row from which no change of another row may tear it apart; two legs may stand further apart."""
TORN_ROW = "a row with another step would be torn apart"
BARE_PLACE = "a part would hold fewer parts of the row there than elsewhere"
MIN_BAYS_SHORTENED = 3
"""Parts of a row from which a bay between two of them can be removed."""
MIN_AREA_SHARE = 0.005
"""Share of the surface of an exemplar from which the parts of a row can be seen; balusters of a house cannot."""
TOO_SMALL = "its parts are too small to be seen"
MAX_PLANES = 160
"""Ends of slabs that are tried for each step and normal."""

LENGTHENING, CUTTING, STRETCHING = range(3)
"""What happens to parts that hold a row, the best first."""
MIN_STRETCHING_ROW = 3
"""Parts of a row from which a part that holds it is stretched; two handles do not tell how many drawers there are."""
MAX_STRETCHING_PLACES = 2
"""Places of a row that are tried where parts are stretched: a try moves all vertices and looks for contacts."""


class _Place(NamedTuple):
    """End of a slab, whether it can be inserted and removed, and what that does to parts that span it.

    held: the types of the parts that a period copies, by the spanning part that they touch
    """

    at: float
    may_insert: bool
    may_remove: bool
    cost: int
    held: Mapping[int, Counter[int]]


@dataclass(frozen=True)
class Row:
    """Places where periods of one kind can be inserted or removed.

    step: index of the step among those of the exemplar
    normal: float64 (3,)
    shift: float64 (3,)
    count: parts of the longest row with this step
    copied: the parts of the exemplar that a period holds, by their types, ascending
    insertions: ends of slabs that can be inserted, float64 (k,)
    removals: ends of slabs that can be removed, float64 (k,)
    is_bay: whether a period is a bay: everything between two of the parts
    """

    step: int
    normal: FloatArray
    shift: FloatArray
    count: int
    copied: tuple[int, ...]
    insertions: FloatArray
    removals: FloatArray
    is_bay: bool = False

    def insertion(self, index: int, times: int) -> RowChange:
        """Return the insertion of `times` periods at one of the places."""
        return RowChange(self.normal, self.shift, float(self.insertions[index]), times, self.is_bay)

    def removal(self, index: int) -> RowChange:
        """Return the removal of the period at one of the places."""
        return RowChange(self.normal, self.shift, float(self.removals[index]), -1, self.is_bay)


def find_rows(
    layout: Layout,
    steps: Sequence[Step] | None = None,
    refuse: Callable[[str], None] = lambda _: None,
    may_stretch: bool = False,
) -> list[Row]:
    """Return the rows of a layout with one of the steps, by default its own.

    refuse: is told why a place of a row was left out although it fits its neighbours
    may_stretch: whether there are rows, too, whose change stretches a part that holds them
    """
    rows: list[Row] = []
    steps = steps_of(layout) if steps is None else steps
    all_mates = [layout.mates(step.shift) for step in steps]
    long_rows = [with_long_rows(mates, MIN_TORN_ROW) for mates in all_mates]
    for number, (step, mates) in enumerate(zip(steps, all_mates, strict=True)):
        count = longest_row(mates)
        if count < 1:
            continue
        others = [
            other
            for index, other in enumerate(long_rows)
            if index != number and not steps[index].is_bay and (other >= 0).any()
        ]
        for normal in step.normals():
            ends = _bay_ends_along(layout, normal, steps, all_mates)
            rows += _rows_along(layout, number, step, count, normal, mates, others, ends, refuse, may_stretch)
    return [
        row
        for row in rows
        if not any(_splits_units(layout, row, other) or _is_multiple(layout, row, other) for other in rows)
    ]


def is_visible(exemplar: Layout, copied: Sequence[int], count: int) -> bool:
    """Return whether `count` periods that copy parts of these types have at least MIN_AREA_SHARE of the surface of an
    exemplar.
    """
    period = sum(float(exemplar.areas[exemplar.types == kind].mean()) for kind in copied)
    return count * period >= MIN_AREA_SHARE * float(exemplar.areas.sum())


def _bay_ends_along(
    layout: Layout, normal: FloatArray, steps: Sequence[Step], all_mates: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the parts at the ends of bays along a normal, int64 (k,), ascending; none where no step is a bay's."""
    found = np.zeros(len(layout), dtype=bool)
    for step, mates in zip(steps, all_mates, strict=True):
        if step.is_bay and normal @ step.shift > 0:
            ends = np.flatnonzero(bay_ends(layout, step.shift) & (mates >= 0))
            found[ends] = found[mates[ends]] = True
    return np.flatnonzero(found)


def _splits_units(layout: Layout, row: Row, whole: Row) -> bool:
    """Return whether a row of two takes only some parts of a unit of another row, such as the sides of a window."""
    if row.count != MIN_ROW or row.step == whole.step or row.is_bay or whole.is_bay:
        return False
    units = _units(layout, whole.shift)
    takes = (layout.mates(row.shift) >= 0) | (layout.mates(-row.shift) >= 0)
    taken, left = units[takes & (units >= 0)], units[~takes & (units >= 0)]
    return bool(np.intersect1d(taken, left).size)


def _is_multiple(layout: Layout, row: Row, other: Row) -> bool:
    """Return whether periods of another row, two or more at once, insert all the types that a row does.

    Over a longer step fewer parts recur: two columns of windows would lack the one that stands where a door is.
    """
    times = round(float(row.shift @ other.shift) / float(other.shift @ other.shift))
    return (
        times > 1
        and not (row.is_bay or other.is_bay)
        and bool((row.normal == other.normal).all())
        and bool(np.abs(row.shift - times * other.shift).max() <= times * layout.tolerance)
        and set(row.copied) <= set(other.copied)
    )


def _units(layout: Layout, shift: FloatArray) -> np.ndarray:
    """Return the unit of each part that has a part one step before or after, int64 (n,), or -1.

    A unit is a connected set of such parts that does not reach from one period into the next.
    """
    mates, previous = layout.mates(shift), layout.mates(-shift)
    recurs = (mates >= 0) | (previous >= 0)
    inner = layout.edges[recurs[layout.edges].all(axis=1)]
    units = np.where(recurs, replace(layout, edges=inner).pieces(), -1)
    first = np.flatnonzero(mates >= 0)
    joined = np.unique(units[first[units[first] == units[mates[first]]]])
    return np.where(np.isin(units, joined), -1, units)


def _rows_along(
    layout: Layout,
    number: int,
    step: Step,
    count: int,
    normal: FloatArray,
    mates: np.ndarray,
    others: Sequence[np.ndarray],
    ends: np.ndarray,
    refuse: Callable[[str], None],
    may_stretch: bool,
) -> Iterator[Row]:
    """Yield the rows with one step and one normal, by what a period holds.

    mates, others: the part one step after each, of this step and of other long rows
    ends: parts at the ends of bays along the normal, int64 (k,)
    """
    low, high = layout.spans(normal)
    previous = layout.mates(-step.shift)
    recurs = (mates >= 0) | (previous >= 0)
    found: dict[tuple[int, ...], list[_Place]] = {}
    if step.is_bay:
        planes = np.unique(np.round(low[bay_ends(layout, step.shift) & (previous >= 0)], ROUNDING_DECIMALS))
    else:
        planes = _planes(layout, low, high, recurs)
        planes = planes[_may_end_slabs(layout, planes, float(normal @ step.shift), low, high, mates, previous)]
    dense = [parts_of_dense_row(layout, other, normal, step.shift) for other in others]
    for at in planes.tolist():
        slab = Slab(layout, normal, step.shift, at, mates, previous, low, high, step.is_bay)
        may_insert = slab.insertion_fault() is None
        may_remove = slab.removal_fault() is None and not (step.is_bay and count < MIN_BAYS_SHORTENED)
        if not (may_insert or may_remove) or not (may_stretch or slab.is_regular or not slab.stretches):
            continue
        fits = may_insert, may_remove
        may_insert = may_insert and not any(slab.tears(other, 1) for other in others)
        may_insert = may_insert and not any(map(slab.leaves_gap, dense))
        may_insert = may_insert and not slab.leaves_end_behind(ends)
        may_remove = may_remove and not any(slab.tears(other, -1) for other in others)
        if fits != (may_insert, may_remove):
            refuse(TORN_ROW)
        if may_insert or may_remove:
            copied = tuple(sorted(layout.types[slab.recurs].tolist()))
            cost = LENGTHENING if slab.is_regular else STRETCHING if slab.stretches else CUTTING
            if cost == STRETCHING and (count < MIN_STRETCHING_ROW or slab.leaves_some_uncopied):
                continue
            found.setdefault(copied, []).append(_Place(at, may_insert, may_remove, cost, slab.held))
    for copied, places in _without_bare_places(found, refuse).items():
        # A cut leaves vertices, after which a part may no longer repeat itself elsewhere.
        cost = min(place.cost for place in places)
        best = [place for place in places if place.cost == cost]
        if cost == STRETCHING and not is_visible(layout, copied, count):
            continue
        if cost == STRETCHING:
            best = list(_tried(layout, normal, step, best))
        insertions = np.array([place.at for place in best if place.may_insert])
        removals = np.array([place.at for place in best if place.may_remove])
        if len(insertions) or len(removals):
            yield Row(number, normal, step.shift, count, copied, insertions, removals, step.is_bay)


def _without_bare_places(
    found: Mapping[tuple[int, ...], Sequence[_Place]], refuse: Callable[[str], None]
) -> dict[tuple[int, ...], list[_Place]]:
    """Return the places of a row without those where a part becomes longer and holds less than at another place.

    A wall would get a blank stretch at its door, where windows are elsewhere.
    """
    held_by: dict[int, list[Counter[int]]] = {}
    for place in chain.from_iterable(found.values()):
        for holder, held in place.held.items():
            known = held_by.setdefault(holder, [])
            if held not in known:
                known.append(held)
    kept: dict[tuple[int, ...], list[_Place]] = {}
    for copied, places in found.items():
        for place in places:
            if any(held < other for holder, held in place.held.items() for other in held_by[holder]):
                refuse(BARE_PLACE)
            else:
                kept.setdefault(copied, []).append(place)
    return kept


def _tried(layout: Layout, normal: FloatArray, step: Step, places: Sequence[_Place]) -> Iterator[_Place]:
    """Yield a few of the places, with those changes that parts that are stretched allow."""
    for index in np.unique(np.linspace(0, len(places) - 1, min(len(places), MAX_STRETCHING_PLACES)).astype(int)):
        place = places[index]
        allowed = []
        for times, may_change in ((1, place.may_insert), (-1, place.may_remove)):
            try:
                if may_change:
                    repeat(layout, RowChange(normal, step.shift, place.at, times, step.is_bay))
                allowed.append(may_change)
            except SlabError:
                allowed.append(False)
        yield place._replace(may_insert=allowed[0], may_remove=allowed[1])


def _may_end_slabs(
    layout: Layout,
    planes: FloatArray,
    length: float,
    low: FloatArray,
    high: FloatArray,
    mates: np.ndarray,
    previous: np.ndarray,
) -> BoolArray:
    """Return where a slab that is no bay may be inserted or removed as far as most of the rules of `Slab` tell, bool
    (p,).

    These rules are asked of all planes at once. Few planes pass them, and only these are asked the others.
    planes: ends of slabs, float64 (p,)
    mates, previous: as of `Slab`
    """
    tolerance, has_previous = layout.tolerance, previous >= 0
    recurs = (mates >= 0) | has_previous
    starts, ends = (planes - length)[:, None], planes[:, None]
    beyond = low >= ends - tolerance
    within = (low >= starts - tolerance) & ~beyond
    crosses = high > ends + tolerance
    spanning = (low < starts - tolerance) & crosses
    before = ~(within | beyond | spanning)
    recurring = within & recurs
    i, j = np.concatenate([layout.edges, layout.edges[:, ::-1]]).T
    holds_row = np.zeros(len(i), dtype=bool)
    for beside in (mates[i], previous[i]):
        holds_row |= (beside >= 0) & np.isin(beside * len(layout) + j, layout.contact_keys)
    once = recurs[i] & ~holds_row
    across = within[:, i] & beyond[:, j]
    returns = has_previous[j] & within[:, previous[j]]
    refused = ~recurring.any(axis=1) | (before[:, i] & beyond[:, j]).any(axis=1) | (across & ~returns).any(axis=1)
    refused |= (within[:, i[once]] & spanning[:, j[once]]).any(axis=1)
    holds_unique = within & ~recurs
    never_inserted = (crosses & (holds_unique | (within & ~has_previous))).any(axis=1)
    never_inserted |= (across & ~(recurs[i] & recurs[previous[j]])).any(axis=1)
    led = mates >= 0
    leads_in, leads_out = led & recurring[:, mates], led & beyond[:, mates]
    never_removed = holds_unique.any(axis=1)
    never_removed |= (before & (high > starts + tolerance) & ~leads_in).any(axis=1)
    never_removed |= (within[:, i] & before[:, j] & ~leads_out[:, i]).any(axis=1)
    allowed: BoolArray = ~(refused | (never_inserted & never_removed))
    return allowed


def _planes(layout: Layout, low: FloatArray, high: FloatArray, recurs: np.ndarray) -> FloatArray:
    """Return ends of slabs worth trying, ascending: ends of recurring parts, and the middles between these."""
    ends = np.sort(np.concatenate([low[recurs], high[recurs]]))
    if not len(ends):
        return ends
    ends = ends[np.concatenate([[True], np.diff(ends) > 2.0 * layout.tolerance])]
    planes = np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))
    chosen = planes[np.unique(np.linspace(0, len(planes) - 1, min(len(planes), MAX_PLANES)).astype(np.int64))]
    rounded: FloatArray = np.round(chosen, ROUNDING_DECIMALS)
    return rounded
