"""Random layouts of an exemplar: fronts are divided, parts in graded rows and scattered ones become more or fewer, and
a few other rows are made longer or shorter, one after another.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from stages.rows.changes import Change
from stages.rows.divisions import Division, divided, find_divisions
from stages.rows.graded_rows import GradedRow, Respacing, find_graded_rows, renumbered, respaced
from stages.rows.layout import Layout
from stages.rows.mirrored_bays import MIRRORED_ENDS, MirroredBay, find_mirrored_bays, with_mirrored_bays
from stages.rows.modular_bays import ModularBay, find_modular_bays, with_modular_bays
from stages.rows.rows import TOO_SMALL, Row, find_rows, is_visible
from stages.rows.scattered import ScatteredParts, Scattering, find_scattered_parts
from stages.rows.settings import RowsConfig
from stages.rows.slabs import RowChange, SlabError, repeat
from stages.rows.steps import bays_of, longest_row, steps_of
from stages.rows.turns import MIN_SECTORS, Circle, Turn, find_circles, turned
from stages.shape.arrays import BoolArray, FloatArray

MAX_PARTS_FACTOR = 4.0
"""Maximum number of parts of a layout, as a multiple of that of its exemplar."""
MAX_SIDE_FACTOR = 3.0
"""Maximum side of the box around a layout, as a multiple of that of its exemplar, before its size is restored."""
MAX_LAYOUTS_REMEMBERED = 400
TRIES_PER_CHANGE = 6
DIVIDED_SHARE = 0.5
"""Share of the layouts with divided fronts, where other changes are possible too."""
RESPACED_SHARE = 0.5
"""Share of the layouts with more or fewer parts in graded rows, where other changes are possible too."""
SCATTERED_SHARE = 0.5
"""Share of the layouts with more or fewer scattered parts, where other changes are possible too."""


def repeated_parts(
    layout: Layout, rows: Sequence[Row], circles: Sequence[Circle], divisions: Sequence[Sequence[Division]]
) -> BoolArray:
    """Return which parts rows along a line or about an axis repeat, or are fronts that are divided, bool (n,)."""
    kinds = [kind for row in rows if not row.is_bay for kind in row.copied]
    repeated: BoolArray = np.isin(layout.types, kinds)
    for circle in circles:
        repeated[circle.orbits] = True
    for alike in divisions:
        repeated[[part for division in alike for part in division.fronts]] = True
    return repeated


def repeated_or_graded(repeated: BoolArray, graded: Sequence[Sequence[GradedRow]]) -> BoolArray:
    """Return which parts are repeated or in a graded row, bool (n,)."""
    changed = repeated.copy()
    for peers in graded:
        changed[[part for row in peers for part in row.parts]] = True
    return changed


class LayoutDraws:
    """Draws layouts of one exemplar. What it remembers saves time and never changes a result."""

    def __init__(self, layout: Layout, config: RowsConfig, is_alone: bool = False, up: int | None = None) -> None:
        """Find the rows of a layout.

        is_alone: whether nothing but rows makes layouts: then bays are inserted and removed too, those of modules where
            there are no rows, and rows that are too small to be seen stay as they are
        up: index of the axis that points up; with it, bays between mirrored ends are inserted and fronts are divided
        """
        self.exemplar, self.config, self._is_alone = layout, config, is_alone
        self.steps = [*steps_of(layout), *(bays_of(layout) if is_alone else ())]
        self.refused = Counter[str]()  # places of the exemplar's rows that were left out, by reason
        self._rows: dict[bytes, list[Row]] = {}
        self._limits = [self._limits_of(step.count) for step in self.steps]
        self.circles = find_circles(layout)
        self.mirrored_bays: list[MirroredBay] = [] if up is None else find_mirrored_bays(layout, up)
        self._with_bays: dict[tuple[int, int], tuple[RowChange, Layout | None]] = {}
        self.modular_bays: list[ModularBay] = []
        if is_alone and not (self.rows or self.circles):
            self.modular_bays = find_modular_bays(layout, {0, 1, 2} - {bay.axis for bay in self.mirrored_bays})
        self.divisions: list[list[Division]] = []
        if is_alone and up is not None and config.divide_fronts:
            self.divisions = find_divisions(layout, up)
        self.graded_rows: list[list[GradedRow]] = []
        self.scattered: list[ScatteredParts] = []
        if is_alone and not self.modular_bays:
            repeated = repeated_parts(layout, self.rows, self.circles, self.divisions)
            self.graded_rows = find_graded_rows(layout, repeated)
            if up is not None:
                self.scattered = find_scattered_parts(layout, up, repeated_or_graded(repeated, self.graded_rows))
        self._with_modules: dict[tuple[tuple[int, int], ...], tuple[RowChange, Layout] | None] = {}
        self._with_respacings: dict[tuple[Respacing, ...], Layout | None] = {}

    @property
    def can_change(self) -> bool:
        """Whether any change of the exemplar is possible."""
        return bool(self._has_others or self.graded_rows or self.scattered)

    @property
    def _has_others(self) -> bool:
        """Whether a change of something else than graded rows and scattered parts is possible."""
        return bool(self.rows or self.has_bays_or_circles or self.divisions)

    @property
    def has_bays_or_circles(self) -> bool:
        """Whether there are circles, bays between mirrored ends, or bays of modules."""
        return bool(self.circles or self.mirrored_bays or self.modular_bays)

    @property
    def rows(self) -> Sequence[Row]:
        """The rows of the exemplar along a line."""
        return self._rows_of(self.exemplar)

    def draw(self, rng: np.random.Generator) -> tuple[tuple[Change, ...], Layout] | None:
        """Return changes and the layout that they make, or None where no change was possible."""
        layout, changes = self.exemplar, list[Change]()
        if self.scattered and (not (self._has_others or self.graded_rows) or rng.random() < SCATTERED_SHARE):
            changes, layout = self._drawn_scattering(rng)
            if changes or not (self._has_others or self.graded_rows):
                return self._with_other_rows(layout, changes, rng) if changes else None
        if self.graded_rows and (not self._has_others or rng.random() < RESPACED_SHARE):
            changes, layout = self._drawn_respacings(rng)
            if changes or not self._has_others:
                return self._with_other_rows(layout, changes, rng) if changes else None
        division = self._drawn_division(rng)
        if division is not None:
            return self._with_other_rows(divided(layout, division), [division], rng)
        first = self._drawn_bays(rng) or self._drawn_circle(rng)
        if first is None and self.modular_bays:
            return self._drawn_modules(rng)
        if first is not None:
            change, made = first
            if made is None:
                return None
            changes, layout = [change], made
        if not self.rows and (self.circles or self.mirrored_bays):
            return (tuple(changes), layout) if changes else None
        return self._with_other_rows(layout, changes, rng)

    def _with_other_rows(
        self, layout: Layout, changes: list[Change], rng: np.random.Generator
    ) -> tuple[tuple[Change, ...], Layout] | None:
        """Return a changed exemplar whose rows change too, or None where nothing has changed.

        changes: those that have made `layout`; with divisions, graded rows or scattered parts among them, other rows
            may stay as they are
        """
        # Along inserted bays a row would change in one bay alone, and leave a blank stretch of wall in another.
        barred = changes[0].normal if changes and isinstance(changes[0], RowChange) else None
        changed_shifts = set[bytes]()
        is_new = any(isinstance(change, Division | Respacing | Scattering) for change in changes)
        for _ in range(int(rng.integers(1, self.config.max_changes + 1)) - is_new if self.rows else 0):
            for _ in range(TRIES_PER_CHANGE):
                changed = self._change(layout, rng, barred, changed_shifts)
                if changed is not None:
                    layout = changed[1]
                    changes += changed[0]
                    break
        return (tuple(changes), layout) if changes and layout.key != self.exemplar.key else None

    def _drawn_respacings(self, rng: np.random.Generator) -> tuple[list[Change], Layout]:
        """Return changes of some graded rows of the exemplar, and the layout with them; only valid draws are in it."""
        layout, changes = self.exemplar, list[Respacing]()
        for number in rng.permutation(len(self.graded_rows))[: int(rng.integers(1, self.config.max_changes + 1))]:
            rows = [row.parts for row in self.graded_rows[number]]
            for change in changes:
                removed = [part for parts in change.rows for part in parts]
                rows = [renumbered(parts, removed) for parts in rows]
            least, most = self._limits_of(len(rows[0]))
            for _ in range(TRIES_PER_CHANGE):
                count = int(rng.integers(least, most + 1))
                if count != len(rows[0]):
                    made = self._respaced(layout, (*changes, Respacing(tuple(rows), count)))
                    if made is not None:
                        changes.append(Respacing(tuple(rows), count))
                        layout = made
                        break
        return [*changes], layout

    def _drawn_scattering(self, rng: np.random.Generator) -> tuple[list[Change], Layout]:
        """Return a change of some scattered parts of the exemplar, and the layout with it; none if it is not valid."""
        scattered = self.scattered[int(rng.integers(len(self.scattered)))]
        least, most = self._limits_of(len(scattered.members))
        made = scattered.drawn(int(rng.integers(least, most + 1)), rng)
        if made is None or made[0].count < least or not self._is_within_limits(made[1]):
            return [], self.exemplar
        return [made[0]], made[1]

    def _respaced(self, layout: Layout, changes: tuple[Respacing, ...]) -> Layout | None:
        """Return a layout with the last of some changes, or None where it is not valid; the others have made it."""
        if changes not in self._with_respacings:
            if len(self._with_respacings) >= MAX_LAYOUTS_REMEMBERED:
                self._with_respacings.clear()
            self._with_respacings[changes] = None
            with suppress(SlabError):
                made = respaced(layout, changes[-1])
                if self._is_within_limits(made):
                    self._with_respacings[changes] = made
        return self._with_respacings[changes]

    def _drawn_division(self, rng: np.random.Generator) -> Division | None:
        """Return fronts that are divided, or None where something else is changed."""
        if not self.divisions or ((self.rows or self.has_bays_or_circles) and rng.random() >= DIVIDED_SHARE):
            return None
        alike = self.divisions[int(rng.integers(len(self.divisions)))]
        return alike[int(rng.integers(len(alike)))]

    def _drawn_modules(self, rng: np.random.Generator) -> tuple[tuple[Change, ...], Layout] | None:
        """Return the exemplar with more or fewer bays of modules along one axis or several, or None."""
        layout, changes, drawn = self.exemplar, list[Change](), list[tuple[int, int]]()
        axes = sorted({bay.axis for bay in self.modular_bays})
        for axis in rng.permutation(axes)[: int(rng.integers(1, self.config.max_changes + 1))].tolist():
            bays = [number for number, bay in enumerate(self.modular_bays) if bay.axis == axis]
            for _ in range(TRIES_PER_CHANGE):
                number = bays[int(rng.integers(len(bays)))]
                count = self.modular_bays[number].count
                least, most = self._limits_of(count)
                drawn.append((number, int(rng.integers(least, most + 1)) - count))
                made = self._with_modular_bay(layout, tuple(drawn))
                if made is not None:
                    changes.append(made[0])
                    layout = made[1]
                    break
                drawn.pop()
        return (tuple(changes), layout) if changes else None

    def _with_modular_bay(self, layout: Layout, drawn: tuple[tuple[int, int], ...]) -> tuple[RowChange, Layout] | None:
        """Return the last of the drawn changes, each a bay and the number of bays inserted, and the layout with it."""
        if drawn not in self._with_modules:
            if len(self._with_modules) >= MAX_LAYOUTS_REMEMBERED:
                self._with_modules.clear()
            number, times = drawn[-1]
            self._with_modules[drawn] = None
            change = self.modular_bays[number].change(times)
            with suppress(SlabError):
                made = None if change is None else with_modular_bays(layout, change)
                if change is not None and made is not None and self._is_within_limits(made):
                    self._with_modules[drawn] = change, made
        return self._with_modules[drawn]

    def _drawn_bays(self, rng: np.random.Generator) -> tuple[RowChange, Layout | None] | None:
        """Return bays that are inserted between mirrored ends, or None where others, rows or circles are changed alone.

        The layout with these bays comes with them, or None where it is not valid or exceeds the limits.
        """
        count = len(self.mirrored_bays)
        most = self._limits_of(MIRRORED_ENDS)[1] - MIRRORED_ENDS
        others = len(self.circles) + len(self.rows) + len({bay.axis for bay in self.modular_bays})
        if not count or most < 1 or rng.integers(count + others) >= count:
            return None
        bay, times = int(rng.integers(count)), int(rng.integers(1, most + 1))
        if (bay, times) not in self._with_bays:
            change = self.mirrored_bays[bay].insertion(times)
            self._with_bays[bay, times] = change, self._inserted(change)
        return self._with_bays[bay, times]

    def _inserted(self, change: RowChange) -> Layout | None:
        """Return the exemplar with more bays between its ends, or None where that is not valid or exceeds limits."""
        try:
            made = with_mirrored_bays(self.exemplar, change)
        except SlabError:
            return None
        return made if self._is_within_limits(made) else None

    def _drawn_circle(self, rng: np.random.Generator) -> tuple[Turn, Layout] | None:
        """Return another number of sectors of a circle and the layout with it, or None where the circle stays."""
        if not self.circles or rng.integers(len(self.circles) + len(self.rows)) >= len(self.circles):
            return None
        circle = self.circles[int(rng.integers(len(self.circles)))]
        least, most = self._limits_of(circle.sectors)
        count = int(rng.integers(max(least, MIN_SECTORS), most + 1))
        if count == circle.sectors:
            return None
        return circle.turn(count), turned(self.exemplar, circle.turn(count))

    def _is_within_limits(self, layout: Layout) -> bool:
        """Return whether a layout is neither too large nor of too many parts."""
        if len(layout) > MAX_PARTS_FACTOR * len(self.exemplar):
            return False
        return bool((layout.extent <= MAX_SIDE_FACTOR * self.exemplar.extent).all())

    def _change(
        self, layout: Layout, rng: np.random.Generator, barred: FloatArray | None, changed_shifts: set[bytes]
    ) -> tuple[list[RowChange], Layout] | None:
        """Return one row of a layout made longer or shorter, or None where the draw is not valid.

        barred: direction along which rows stay as they are, float64 (3,), or None
        changed_shifts: shifts of the rows that have been changed; each changes once, and that of this change is added.
            A house that was shortened to two storeys no longer shows that a window belongs over the door.
        """
        # A layout with fewer parts than the exemplar may allow a step that the exemplar refuses.
        allowed_steps = {row.step for row in self.rows}
        rows = [
            row
            for row in self._rows_of(layout)
            if row.step in allowed_steps
            and row.shift.tobytes() not in changed_shifts
            and (barred is None or not row.shift @ barred)
        ]
        if not rows:
            return None
        row = rows[int(rng.integers(len(rows)))]
        least, most = self._limits[row.step]
        wanted = int(rng.integers(least, most + 1))
        if wanted > row.count and len(row.insertions):
            change = row.insertion(int(rng.integers(len(row.insertions))), wanted - row.count)
            longer = self._repeated(layout, change)
            changed = None if longer is None else ([change], longer)
        else:
            changed = self._shortened(layout, row, wanted, rng)
        if changed is not None:
            changed_shifts.add(row.shift.tobytes())
        return changed

    def _shortened(
        self, layout: Layout, row: Row, wanted: int, rng: np.random.Generator
    ) -> tuple[list[RowChange], Layout] | None:
        """Return a row with periods removed one by one until it has `wanted` parts, or as few as possible."""
        changes: list[RowChange] = []
        while wanted < row.count and len(row.removals):
            change = row.removal(int(rng.integers(len(row.removals))))
            shorter = self._repeated(layout, change)
            if shorter is None:
                break
            changes.append(change)
            layout = shorter
            same = [other for other in self._rows_of(layout) if _same_row(other, row) and other.count < row.count]
            if not same:
                break
            row = same[0]
        return (changes, layout) if changes else None

    def _repeated(self, layout: Layout, change: RowChange) -> Layout | None:
        """Return a changed layout within the limits, or None."""
        try:
            changed = repeat(layout, change)
        except SlabError:
            return None
        if not self._is_within_limits(changed):
            return None
        for step, (least, most) in zip(self.steps, self._limits, strict=True):
            if step.is_bay and not change.is_bay:
                continue
            count = max(longest_row(changed.mates(step.shift)), 1)
            if count > most or (count < least and change.times < 0):
                return None
        return changed

    def _limits_of(self, count: int) -> tuple[int, int]:
        """Return the minimum and the maximum length of a row of `count` parts in the exemplar."""
        least, most = int(self.config.min_count * count), int(self.config.max_count * count)
        return max(least, 1), most

    def _rows_of(self, layout: Layout) -> list[Row]:
        key = layout.key + layout.poses[:1].tobytes()
        if key not in self._rows:
            if len(self._rows) >= MAX_LAYOUTS_REMEMBERED:
                self._rows.clear()
            counted = self.refused if layout is self.exemplar else Counter[str]()
            rows = find_rows(layout, self.steps, lambda reason: counted.update([reason]), may_stretch=self._is_alone)
            if self._is_alone:
                counted.update([TOO_SMALL] * sum(not is_visible(self.exemplar, row.copied, row.count) for row in rows))
                rows = [row for row in rows if is_visible(self.exemplar, row.copied, row.count)]
            self._rows[key] = rows
        return self._rows[key]


def _same_row(first: Row, second: Row) -> bool:
    return first.step == second.step and first.copied == second.copied and bool((first.normal == second.normal).all())
