"""Infer neighbourhoods that follow from rows: those that exemplars have once their rows are longer or shorter.

A wall of two pieces shows the two ends of a wall and no middle. Its row shows what the middle looks like: each contact
of a longer or shorter row occurs in the exemplar.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stages.rows.layout import Layout, LengthenedMesh, graph_layout
from stages.rows.rows import Row, find_rows
from stages.rows.slabs import RowChange, SlabError, repeat
from stages.shape.geometry.docking import DockingTable
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Grammar, Kit, Multiset

PERIODS_INSERTED = 2
"""Two copies touch each other and what is on either side."""
MAX_PLACES = 4
"""Places of one row at which periods are inserted or removed."""


def with_row_neighbourhoods(kit: Kit) -> Grammar:
    """Return the grammar of a kit with the neighbourhoods that follow from the rows of its exemplars; their count is 0.

    Rows whose change makes a part longer or shorter are left out, and so are contacts that are no docking of the kit.
    Nothing follows for parts by meaning, and for grammars of slots, which hold what exemplars show at each place.
    """
    grammar = kit.grammar
    if kit.by_meaning or grammar.strictness in SLOT_LEVELS:
        return grammar
    dockings = DockingTable.of(kit)
    rules: dict[int, dict[Multiset, int]] = {kind: dict(seen) for kind, seen in grammar.neighbourhoods.items()}
    for exemplar in kit.exemplars:
        for layout in _changed_layouts(graph_layout(kit, exemplar)):
            if any(isinstance(mesh, LengthenedMesh) for mesh in layout.meshes):
                continue
            if (dockings.label_edges(layout.types, layout.poses, layout.edges) < 0).any():
                continue
            labelled = kit.labelled(layout.assembly())
            for kind, near in zip(labelled.types.tolist(), labelled.neighbours(), strict=True):
                if kind not in grammar.hubs:
                    rules[kind].setdefault(labelled.multiset(near), 0)
    return replace(grammar, neighbourhoods=rules)


def _changed_layouts(layout: Layout) -> Iterator[Layout]:
    """Yield a layout with each of its rows longer and shorter, and with rows of two directions longer."""
    rows = find_rows(layout)
    for row in rows:
        yield from _changed_row(layout, row)
    for first in _first_by_direction(rows):
        longer = _repeated(layout, first.insertion(0, PERIODS_INSERTED))
        if longer is None:
            continue
        for row in find_rows(longer):
            if np.linalg.norm(np.cross(row.shift, first.shift)) > 0.0:
                yield from _changed_row(longer, row)


def _changed_row(layout: Layout, row: Row) -> Iterator[Layout]:
    changes = [row.insertion(index, PERIODS_INSERTED) for index in _spread(len(row.insertions))]
    changes += [row.removal(index) for index in _spread(len(row.removals))]
    for change in changes:
        changed = _repeated(layout, change)
        if changed is not None:
            yield changed


def _repeated(layout: Layout, change: RowChange) -> Layout | None:
    try:
        return repeat(layout, change)
    except SlabError:
        return None


def _first_by_direction(rows: Sequence[Row]) -> list[Row]:
    """Return the first row with insertions along each axis of its slabs."""
    first: dict[bytes, Row] = {}
    for row in rows:
        if len(row.insertions):
            first.setdefault(row.normal.tobytes(), row)
    return list(first.values())


def _spread(count: int) -> list[int]:
    """Return at most MAX_PLACES indices below a count, evenly spread."""
    return sorted(set(np.linspace(0, count - 1, min(count, MAX_PLACES)).astype(int).tolist()))
