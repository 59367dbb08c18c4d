"""The rows of a kit, in words and numbers, as `make inspect` says them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.rows.divisions import Division, find_divisions
from stages.rows.draws import repeated_or_graded, repeated_parts
from stages.rows.graded_rows import GradedRow, find_graded_rows
from stages.rows.layout import Layout, layout_of
from stages.rows.mirrored_bays import MIRRORED_ENDS, MirroredBay, find_mirrored_bays
from stages.rows.modular_bays import ModularBay, find_modular_bays
from stages.rows.rows import Row, find_rows, is_visible
from stages.rows.scattered import ScatteredParts, find_scattered_parts
from stages.rows.steps import bay_ends, bays_of
from stages.rows.turns import Circle, find_circles
from stages.shape.kit import Kit

MAX_LABELS_SHOWN = 3
MAX_RATIO_DIFFERENCE = 0.02
"""Difference from a whole number up to which one step is a multiple of another."""


@dataclass(frozen=True)
class KitRow:
    """A row of an exemplar that can become longer or shorter, or fronts that can be divided.

    exemplar: name of the exemplar
    labels: number of parts of each label in one period, most frequent first; of a bay, the labels of its ends
    count: parts of the row, or scattered parts; of divided fronts, the largest number of pieces of each
    direction: `along x`, `along y`, `along z`, `along a slope`, or `about x`, `about y` or `about z`
    """

    exemplar: str
    labels: tuple[tuple[str, int], ...]
    count: int
    direction: str
    is_bay: bool = False
    is_mirrored: bool = False
    is_modular: bool = False
    is_division: bool = False
    is_scattered: bool = False

    @property
    def change(self) -> str:
        """What layouts have instead, such as `divided fronts`."""
        if self.is_division:
            return "divided fronts"
        return "more and fewer scattered parts" if self.is_scattered else "longer and shorter rows"

    @property
    def sentence(self) -> str:
        """What the row is, such as `5 times board, along y`, or `bays between side, along x`."""
        names = [f"{count} {label}" if count > 1 else label for label, count in self.labels[:MAX_LABELS_SHOWN]]
        more = " and more" if len(self.labels) > MAX_LABELS_SHOWN else ""
        if self.is_division:
            return f"{names[0]} in up to {self.count} pieces, {self.direction}"
        if self.is_scattered:
            return f"{self.count} scattered {', '.join(names)}{more}"
        if self.is_modular:
            return f"bays of {', '.join(label for label, _ in self.labels[:MAX_LABELS_SHOWN])}{more}, {self.direction}"
        if self.is_bay:
            ends = ", ".join(label for label, _ in self.labels[:MAX_LABELS_SHOWN])
            return f"bays between {'mirrored ' if self.is_mirrored else ''}{ends}{more}, {self.direction}"
        return f"{self.count} times {', '.join(names)}{more}, {self.direction}"


def rows_of_kit(kit: Kit) -> tuple[KitRow, ...]:
    """Return the rows of all exemplars of a kit that can be seen: circles, then the longest along each direction, then
    bays, those between mirrored ends last; bays of modules where these are missing; graded rows; scattered parts; and
    fronts that can be divided.
    """
    found: list[KitRow] = []
    for exemplar in kit.exemplars:
        layout = layout_of(kit, exemplar)
        turning, along_lines = find_circles(layout), _visible_rows(layout)
        circles = [_turning(kit, exemplar.name, layout, circle) for circle in turning]
        rows = [_described(kit, exemplar.name, row) for row in _main_rows(along_lines)]
        along_bays = [
            row
            for row in find_rows(layout, bays_of(layout), may_stretch=True)
            if is_visible(layout, row.copied, row.count)
        ]
        bays = [_described_bay(kit, exemplar.name, layout, row) for row in along_bays]
        up = "xyz".index(kit.up)
        along_mirrored = find_mirrored_bays(layout, up)
        mirrored = [_described_mirrored(kit, exemplar.name, layout, bay) for bay in along_mirrored]
        modular: list[KitRow] = []
        if not (circles or rows or bays):
            free = {0, 1, 2} - {bay.axis for bay in along_mirrored}
            longest = _longest(find_modular_bays(layout, free))
            modular = [_described_modules(kit, exemplar.name, layout, bay) for bay in longest]
        divisions = find_divisions(layout, up)
        repeated = repeated_parts(layout, along_lines, turning, divisions)
        graded = [] if modular else find_graded_rows(layout, repeated)
        respaced = [_described_graded(kit, exemplar.name, layout, peers) for peers in graded]
        changed = repeated_or_graded(repeated, graded)
        loose = [] if modular else find_scattered_parts(layout, up, changed)
        scattered = [_described_scattered(kit, exemplar.name, layout, parts) for parts in loose]
        found += dict.fromkeys([*circles, *rows, *bays, *mirrored, *modular, *respaced, *scattered])
        for alike in divisions:
            found += _described_divisions(kit, exemplar.name, layout, alike)
    return tuple(found)


def _visible_rows(layout: Layout) -> list[Row]:
    return [row for row in find_rows(layout, may_stretch=True) if is_visible(layout, row.copied, row.count)]


def _main_rows(rows: Sequence[Row]) -> list[Row]:
    """Return of some rows one for each step, that with most places, longest first; without steps of several periods."""
    order = sorted(rows, key=lambda row: (-row.count, -len(row.insertions), row.copied))
    main: list[Row] = []
    for row in order:
        ratios = [np.linalg.norm(row.shift) / np.linalg.norm(other.shift) for other in main if _same_way(row, other)]
        if all(ratio > 1.0 and abs(ratio - round(ratio)) > MAX_RATIO_DIFFERENCE for ratio in ratios):
            main.append(row)
    return main


def _same_way(first: Row, second: Row) -> bool:
    """Return whether two rows have parallel steps."""
    return bool(np.linalg.norm(np.cross(first.shift, second.shift)) < MAX_RATIO_DIFFERENCE * first.shift @ second.shift)


def _turning(kit: Kit, exemplar: str, layout: Layout, circle: Circle) -> KitRow:
    counts = Counter(kit.types[layout.types[part]].label for part in circle.orbits[:, 0].tolist())
    return KitRow(exemplar, tuple(counts.most_common()), circle.sectors, f"about {'xyz'[circle.axis]}")


def _described(kit: Kit, exemplar: str, row: Row) -> KitRow:
    counts = Counter(kit.types[kind].label for kind in row.copied)
    return KitRow(exemplar, tuple(counts.most_common()), row.count, _direction(row))


def _described_bay(kit: Kit, exemplar: str, layout: Layout, row: Row) -> KitRow:
    ends = bay_ends(layout, row.shift) & (layout.mates(row.shift) >= 0)
    counts = Counter(kit.types[kind].label for kind in layout.types[ends].tolist())
    return KitRow(exemplar, tuple(counts.most_common()), row.count, _direction(row), is_bay=True)


def _described_mirrored(kit: Kit, exemplar: str, layout: Layout, bay: MirroredBay) -> KitRow:
    counts = Counter(kit.types[kind].label for kind in layout.types[bay.ends].tolist())
    ends, direction = tuple(counts.most_common()), f"along {'xyz'[bay.axis]}"
    return KitRow(exemplar, ends, MIRRORED_ENDS, direction, is_bay=True, is_mirrored=True)


def _longest(bays: Sequence[ModularBay]) -> list[ModularBay]:
    """Return of the bays along each axis the one of the longest row."""
    by_axis: dict[int, ModularBay] = {}
    for bay in sorted(bays, key=lambda bay: -bay.count):
        by_axis.setdefault(bay.axis, bay)
    return [by_axis[axis] for axis in sorted(by_axis)]


def _described_modules(kit: Kit, exemplar: str, layout: Layout, bay: ModularBay) -> KitRow:
    counts = Counter(kit.types[kind].label for kind in layout.types[bay.parts].tolist())
    labels, direction = tuple(counts.most_common()), f"along {'xyz'[bay.axis]}"
    return KitRow(exemplar, labels, bay.count, direction, is_bay=True, is_modular=True)


def _described_graded(kit: Kit, exemplar: str, layout: Layout, peers: Sequence[GradedRow]) -> KitRow:
    counts = Counter(kit.types[layout.types[row.parts[0]]].label for row in peers)
    row = peers[0]
    return KitRow(
        exemplar, tuple((label, 1) for label, _ in counts.most_common()), len(row.parts), f"along {'xyz'[row.axis]}"
    )


def _described_scattered(kit: Kit, exemplar: str, layout: Layout, scattered: ScatteredParts) -> KitRow:
    counts = Counter(kit.types[layout.types[part]].label for part in scattered.parts)
    labels, direction = tuple((label, 1) for label, _ in counts.most_common()), f"about {'xyz'[scattered.up]}"
    return KitRow(exemplar, labels, len(scattered.members), direction, is_scattered=True)


def _described_divisions(kit: Kit, exemplar: str, layout: Layout, alike: Sequence[Division]) -> list[KitRow]:
    """Return the divisions of fronts of one size, one for each axis."""
    label = kit.types[layout.types[alike[0].fronts[0]]].label
    most: dict[int, int] = {}
    for division in alike:
        most[division.axis] = max(most.get(division.axis, 0), division.count)
    return [
        KitRow(exemplar, ((label, 1),), count, f"along {'xyz'[axis]}", is_division=True)
        for axis, count in sorted(most.items())
    ]


def _direction(row: Row) -> str:
    axes = np.flatnonzero(row.shift)
    return f"along {'xyz'[axes[0]]}" if len(axes) == 1 else "along a slope"
