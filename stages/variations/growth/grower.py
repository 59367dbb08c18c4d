"""Growing shapes of a kit, one a call: what the kernels need, and what each shape is to be like."""

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
from stages.variations.growth.state import WORK, GrowthField, KnownContacts, growing
from stages.variations.kernels.structs import PARTS, UNKNOWNS, KitTables, Outcome, Workspace

LONGEST = 2.5
"""How much longer, beside its other side, a field may be than the exemplar at most."""
WIDEST = 4.0
"""Area of a field at most, as a multiple of what so many parts take in the exemplar: loops need room to close."""
TALLEST = 1.5
"""Height of a field as a multiple of the tallest exemplar's."""
ROOM = 0.25
"""Sizes that are met within this share count as met."""
WORK_A_TRY = 20.0
"""Contacts that growth asks for in the time of one try of the exchange."""
MEMORY = 0.9
"""How much of what was learnt about room for parts is kept from shape to shape."""


class Grower:
    """Grows shapes within limits of size.

    slots: of a kit with a grammar of slots, whose patterns grow then, those that nobody has seen among them; else the
    observed ones do. parts, footprint: (least, most) parts, and sides of the area seen from above in the kit's units,
    the shorter first; None where only `smallest` and `largest` parts, and what room so many parts take in the
    exemplars, set the limits.
    """

    def __init__(
        self,
        answers: ContactOracle,
        tables: KitTables,
        smallest: int,
        largest: int,
        slots: SlotGrammar | None = None,
        parts: tuple[int, int] | None = None,
        footprint: tuple[float, float] | None = None,
    ) -> None:
        kit = answers.kit
        self.kit, self.answers, self.tables = kit, answers, tables
        self.min_parts, self.max_parts = smallest, largest
        self.parts, self.footprint = parts, footprint
        self.patterns = slots.patterns() if slots else observed_patterns(kit, answers.dockings, tables.up >= 0)
        self._tables = pattern_tables(kit, self.patterns)
        self._g = growing(len(kit.types), largest)
        self._asker = answers.c_callback(self._g.spot_types, self._g.spot_rotations, self._g.spot_translations)
        self._address = int(ctypes.cast(self._asker, ctypes.c_void_p).value or 0)
        self._boxes = [_boxes(kit, each.assembly) for each in kit.exemplars]
        self._corners = [(boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)) for boxes in self._boxes]
        self._up = {"y": 1, "z": 2}[kit.up]
        self._level = [axis for axis in range(3) if axis != self._up]
        self._room = 0.0
        self.seed = (0, 0)

    def grow(self, rng: np.random.Generator, ws: Workspace) -> tuple[int, float]:
        """Try to grow one shape into `ws`: how it ended, as an `Outcome`, and the work that it took, in tries of the
        exchange.

        `seed` says then which part of which exemplar it grew from.
        """
        field = self._field(rng)
        table = self.answers.table
        contacts = KnownContacts(table.keys, table.values, self._address)
        grown = grow(rng, self.tables, self._tables, contacts, self._g, field)
        self.answers.raise_pending()
        work = 1.0 + float(self._g.counts[WORK]) / WORK_A_TRY
        if not grown:
            return Outcome.NO_MATCH, work
        outcome = int(take_over(self.tables, self._tables, self.answers.table, self._g, ws))
        while outcome == Outcome.UNKNOWN:
            if not self.answers.answer_unknown(ws, int(ws.counts[UNKNOWNS])):
                return Outcome.CLASH, work
            outcome = int(take_over(self.tables, self._tables, self.answers.table, self._g, ws))
        if outcome == Outcome.OK:
            outcome = self._size(ws, field)
        return outcome, work

    def _size(self, ws: Workspace, field: GrowthField) -> int:
        """OK, TOO_SMALL or TOO_LARGE by what was asked for; and what was learnt of it for the next shape."""
        count = int(ws.counts[PARTS])
        self._room = MEMORY * self._room + (1 - MEMORY) * float(np.clip(np.log(field.target / count), -1.0, 1.0))
        least, most = self.parts or (self.min_parts, self.max_parts)
        if self.parts is not None:
            least, most = round(least * (1 - ROOM)), round(most * (1 + ROOM))
        if count < least:
            return Outcome.TOO_SMALL
        if count > most:
            return Outcome.TOO_LARGE
        if self.footprint is not None:
            boxes = ws.boxes[:count]
            spans = (boxes[:, 0] + boxes[:, 1]).max(axis=0) - (boxes[:, 0] - boxes[:, 1]).min(axis=0)
            shares = np.sort(spans[self._level]) / np.sort(self.footprint)
            if (shares < 1 - ROOM).any():
                return Outcome.TOO_SMALL
            if (shares > 1 + ROOM).any():
                return Outcome.TOO_LARGE
        return Outcome.OK

    def _field(self, rng: np.random.Generator) -> GrowthField:
        """Where the next shape begins, and the room that it has."""
        sizes = np.array([len(each.assembly) for each in self.kit.exemplars])
        number = int(np.searchsorted(sizes.cumsum(), rng.random() * sizes.sum(), side="right").clip(0, len(sizes) - 1))
        assembly = self.kit.exemplars[number].assembly
        part = min(int(rng.random() * len(assembly)), len(assembly) - 1)
        self.seed = number, part
        low, high = self._corners[number]
        least, most = self.parts or (self.min_parts, self.max_parts)
        target = round(float(np.exp(np.log(least) + rng.random() * (np.log(most) - np.log(least)))))
        pose = assembly.poses[part]
        box_low, box_high = self._boxes[number][part]
        spans = high - low
        if self.footprint is not None:
            sides = np.array(self.footprint) * (1 + ROOM / 2)
            if rng.random() < 0.5:
                sides = sides[::-1]
        else:
            scale = target / len(assembly) * np.exp(self._room) * WIDEST ** rng.random()
            aspect = LONGEST ** (2 * rng.random() - 1)
            sides = spans[self._level] * np.sqrt(scale) * np.array([np.sqrt(aspect), 1 / np.sqrt(aspect)])
        # No narrower than a part needs, or nothing fits beside the first.
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
            field_high[self._up] = field_low[self._up] + TALLEST * tallest
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
    """The boxes around the parts as the kernels see them, around the turned boxes of their types, float64 (n, 2, 3)."""
    bounds = np.stack([kit.types[index].bounds for index in assembly.types])
    turns, places = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
    middles = np.einsum("nij,nj->ni", turns, bounds.mean(axis=1)) + places
    halves = np.einsum("nij,nj->ni", np.abs(turns), (bounds[:, 1] - bounds[:, 0]) / 2)
    return np.stack([middles - halves, middles + halves], axis=1)
