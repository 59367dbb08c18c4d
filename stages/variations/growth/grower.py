"""Growing shapes of a kit, one a call: the tables that compiled code needs, and the limits of each shape."""

from __future__ import annotations

import ctypes

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.patterns import observed_patterns
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly, Kit
from stages.variations.growth.grow import grow, take_over
from stages.variations.growth.pattern_tables import pattern_tables
from stages.variations.growth.state import WORK_DONE, GrowthField, GrowthProblem, KnownContacts, new_growth_state
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_PARTS, KitTables, Workspace
from stages.variations.kernels.tables import resolve_unknown

MAX_ASPECT_FACTOR = 2.5
"""How much longer, relative to its other side, a field may be than the exemplar."""
MAX_AREA_FACTOR = 4.0
"""Area of a field relative to what the same number of parts takes in the exemplar: loops need room to close."""
HEIGHT_FACTOR = 1.5
"""Height of a field relative to the tallest exemplar's."""
SIZE_TOLERANCE = 0.25
"""Sizes within this share of what was asked for are met."""
CONTACTS_PER_TRY = 20.0
"""Contacts that growth asks for in the time of one try of the exchange."""
MEMORY_SHARE = 0.9
"""Share of what was learnt about room for parts that is kept from shape to shape."""


class Grower:
    """Grows shapes within limits of size.

    slots: the slot grammar of a kit that has one, whose patterns include unseen ones; otherwise observed patterns grow
    parts: minimum and maximum number of parts, or None: `min_parts` and `max_parts` set the limits
    footprint: sides of the area seen from above in the kit's units, the shorter first; None: as in the exemplars
    """

    def __init__(
        self,
        oracle: ContactOracle,
        tables: KitTables,
        min_parts: int,
        max_parts: int,
        slots: SlotGrammar | None = None,
        parts: tuple[int, int] | None = None,
        footprint: tuple[float, float] | None = None,
    ) -> None:
        kit = oracle.kit
        self.kit, self.oracle, self.tables = kit, oracle, tables
        self.min_parts, self.max_parts = min_parts, max_parts
        self.parts, self.footprint = parts, footprint
        self.patterns = slots.patterns() if slots else observed_patterns(kit, oracle.dockings, tables.up >= 0)
        self._tables = pattern_tables(kit, self.patterns)
        self._state = new_growth_state(len(kit.types), max_parts)
        self._asker = oracle.c_callback(
            self._state.placement_types, self._state.placement_rotations, self._state.placement_translations
        )
        self._address = int(ctypes.cast(self._asker, ctypes.c_void_p).value or 0)
        self._boxes = [_boxes(kit, exemplar.assembly) for exemplar in kit.exemplars]
        self._corners = [(boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)) for boxes in self._boxes]
        self._up = {"y": 1, "z": 2}[kit.up]
        self._level = [axis for axis in range(3) if axis != self._up]
        self._room = 0.0
        self.seed = (0, 0)

    def grow(self, rng: np.random.Generator, ws: Workspace) -> tuple[int, float]:
        """Try to grow one shape into `ws`; return the outcome, and the work in tries of the exchange.

        Afterwards `seed` is the number of the exemplar and of its part that it grew from.
        """
        field = self._field(rng)
        table = self.oracle.table
        contacts = KnownContacts(table.keys, table.values, self._address)
        problem = GrowthProblem(self.tables, self._tables, contacts, field)
        grown = grow(rng, problem, self._state)
        self.oracle.raise_pending()
        work = 1.0 + float(self._state.counts[WORK_DONE]) / CONTACTS_PER_TRY
        if not grown:
            return Outcome.NO_MATCH, work
        outcome = int(take_over(self.tables, self._tables, self.oracle.table, self._state, ws))
        while outcome == Outcome.UNKNOWN:
            if not resolve_unknown(self.oracle, ws):
                return Outcome.CLASH, work
            outcome = int(take_over(self.tables, self._tables, self.oracle.table, self._state, ws))
        if outcome == Outcome.OK:
            outcome = self._size(ws, field)
        return outcome, work

    def _size(self, ws: Workspace, field: GrowthField) -> int:
        """Return OK, TOO_SMALL or TOO_LARGE by the limits; learn from it how much room the next shape needs."""
        count = int(ws.counts[N_PARTS])
        learnt = float(np.clip(np.log(field.target / count), -1.0, 1.0))
        self._room = MEMORY_SHARE * self._room + (1 - MEMORY_SHARE) * learnt
        low, high = self.parts or (self.min_parts, self.max_parts)
        if self.parts is not None:
            low, high = round(low * (1 - SIZE_TOLERANCE)), round(high * (1 + SIZE_TOLERANCE))
        if count < low:
            return Outcome.TOO_SMALL
        if count > high:
            return Outcome.TOO_LARGE
        if self.footprint is not None:
            boxes = ws.boxes[:count]
            spans = (boxes[:, 0] + boxes[:, 1]).max(axis=0) - (boxes[:, 0] - boxes[:, 1]).min(axis=0)
            shares = np.sort(spans[self._level]) / np.sort(self.footprint)
            if (shares < 1 - SIZE_TOLERANCE).any():
                return Outcome.TOO_SMALL
            if (shares > 1 + SIZE_TOLERANCE).any():
                return Outcome.TOO_LARGE
        return Outcome.OK

    def _field(self, rng: np.random.Generator) -> GrowthField:
        """Draw where the next shape begins, and its room."""
        sizes = np.array([len(exemplar.assembly) for exemplar in self.kit.exemplars])
        number = int(np.searchsorted(sizes.cumsum(), rng.random() * sizes.sum(), side="right").clip(0, len(sizes) - 1))
        assembly = self.kit.exemplars[number].assembly
        part = min(int(rng.random() * len(assembly)), len(assembly) - 1)
        self.seed = number, part
        low, high = self._corners[number]
        min_parts, max_parts = self.parts or (self.min_parts, self.max_parts)
        target = round(float(np.exp(np.log(min_parts) + rng.random() * (np.log(max_parts) - np.log(min_parts)))))
        pose = assembly.poses[part]
        box_low, box_high = self._boxes[number][part]
        spans = high - low
        if self.footprint is not None:
            sides = np.array(self.footprint) * (1 + SIZE_TOLERANCE / 2)
            if rng.random() < 0.5:
                sides = sides[::-1]
        else:
            scale = target / len(assembly) * np.exp(self._room) * MAX_AREA_FACTOR ** rng.random()
            aspect = MAX_ASPECT_FACTOR ** (2 * rng.random() - 1)
            sides = spans[self._level] * np.sqrt(scale) * np.array([np.sqrt(aspect), 1 / np.sqrt(aspect)])
        # No narrower than a part needs, or nothing fits next to the first.
        field_low, field_high = low.copy(), high.copy()
        for axis, side in zip(self._level, sides, strict=True):
            size = max(side, 1.01 * (box_high[axis] - box_low[axis]))
            slack = size - (box_high[axis] - box_low[axis])
            field_low[axis] = box_low[axis] - rng.random() * slack
            field_high[axis] = field_low[axis] + size
        hair = 2.0 * self.kit.contact_tolerance
        height = spans[self._up]
        tallest = max(high[self._up] - low[self._up] for low, high in self._corners)
        if self.tables.up >= 0:
            field_high[self._up] = field_low[self._up] + HEIGHT_FACTOR * tallest
        else:
            field_low[self._up] -= height
            field_high[self._up] += height
        return GrowthField(
            int(assembly.types[part]),
            np.ascontiguousarray(pose[:3, :3]),
            np.ascontiguousarray(pose[:3, 3]),
            np.minimum(field_low, box_low) - hair,
            np.maximum(field_high, box_high) + hair,
            target,
            self.max_parts,
        )


def _boxes(kit: Kit, assembly: Assembly) -> FloatArray:
    """Return the boxes around the turned boxes of the parts' types, as compiled code sees them, float64 (n, 2, 3)."""
    bounds = np.stack([kit.types[index].bounds for index in assembly.types])
    turns, places = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
    middles = np.einsum("nij,nj->ni", turns, bounds.mean(axis=1)) + places
    halves = np.einsum("nij,nj->ni", np.abs(turns), (bounds[:, 1] - bounds[:, 0]) / 2)
    return np.stack([middles - halves, middles + halves], axis=1)
