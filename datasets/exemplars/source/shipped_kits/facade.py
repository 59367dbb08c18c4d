"""A house front as one closed mesh without parts: what grammars are found in (symmetry §5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shipped_kits.kit_shape import Layout
from shipped_kits.solids import Color, Face, Point, Solid

BAYS, STOREYS = 5, 3
BAY, STOREY = 1.2, 1.5
MARGIN, PLINTH, CORNICE = 0.45, 0.77, 0.525
"""So that a cut beside a corner, and beside each row of windows, runs through plain wall."""
DEPTH = 0.8
WALL: Color = (214, 186, 150)
STONE: Color = (160, 152, 144)
GLASS: Color = (92, 118, 138)
WOOD: Color = (112, 74, 50)
ROOF: Color = (142, 92, 78)


@dataclass(frozen=True)
class _Block:
    """A box that is added to the house, or taken out of it; later ones win. Its faces are of its colour."""

    low: Point
    high: Point
    solid: bool
    color: Color


def shapes() -> dict[str, Layout]:
    """`townhouse`, one part."""
    layout = Layout({"townhouse": _boundary(_blocks())})
    layout.put("townhouse", 0, 0, 0)
    return {"townhouse": layout}


def _blocks() -> list[_Block]:
    """The wall with plinth and cornice; windows with sills, set back into it; a door in the middle."""
    width, height = 2 * MARGIN + BAYS * BAY, PLINTH + STOREYS * STOREY + CORNICE
    blocks = [
        _Block((0, 0, 0), (width, height, DEPTH), True, WALL),
        _Block((-0.1, 0, -0.1), (width + 0.1, 0.4, DEPTH + 0.1), True, STONE),
        _Block((-0.15, height - 0.3, -0.15), (width + 0.15, height, DEPTH + 0.15), True, ROOF),
    ]
    for storey in range(STOREYS):
        for bay in range(BAYS):
            x, y = MARGIN + bay * BAY, PLINTH + storey * STOREY
            if storey == 0 and bay == BAYS // 2:
                blocks.append(_Block((x + 0.2, 0.4, DEPTH - 0.25), (x + 1.0, y + 1.25, DEPTH), False, WOOD))
                continue
            blocks.append(_Block((x + 0.25, y + 0.25, DEPTH - 0.2), (x + 0.95, y + 1.2, DEPTH), False, GLASS))
            blocks.append(_Block((x + 0.2, y + 0.15, DEPTH), (x + 1.0, y + 0.25, DEPTH + 0.1), True, STONE))
    return blocks


def _boundary(blocks: Sequence[_Block]) -> Solid:
    """What is solid in the end, as the rectangles of its boundary: between the planes of all boxes, each once."""
    ticks = [
        np.unique(np.round([each.low[d] for each in blocks] + [each.high[d] for each in blocks], 6)) for d in range(3)
    ]
    middles = [(each[1:] + each[:-1]) / 2 for each in ticks]
    owner = np.full([len(each) + 2 for each in middles], -1)
    for number, block in enumerate(blocks):
        spans = [
            1 + np.flatnonzero((each > low) & (each < high))
            for each, low, high in zip(middles, block.low, block.high, strict=True)
        ]
        owner[np.ix_(*spans)] = number
    solid = np.array([*(each.solid for each in blocks), False])[owner]
    return _rectangles(ticks, solid, lambda inside, outside: _color(blocks, owner[inside], owner[outside]))


def _color(blocks: Sequence[_Block], inside: int, outside: int) -> Color:
    """Of what was taken out the bottom of the hole, else what stands there."""
    return blocks[outside].color if outside >= 0 and not blocks[outside].solid else blocks[inside].color


Cell = tuple[int, ...]


def _rectangles(ticks: Sequence[np.ndarray], solid: np.ndarray, color: Callable[[Cell, Cell], Color]) -> Solid:
    points: dict[Point, int] = {}
    faces: list[Face] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for cell in map(tuple, np.argwhere(solid).tolist()):
            for side in (0, 1):
                beside = list(cell)
                beside[axis] += 2 * side - 1
                if solid[tuple(beside)]:
                    continue
                corners = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0)):
                    at = [0.0, 0.0, 0.0]
                    at[axis] = float(ticks[axis][cell[axis] - 1 + side])
                    at[u], at[v] = float(ticks[u][cell[u] - 1 + du]), float(ticks[v][cell[v] - 1 + dv])
                    corners.append(points.setdefault((at[0], at[1], at[2]), len(points)))
                faces.append(Face((tuple(corners),), color(cell, tuple(beside))))
    return Solid(np.array(list(points)), tuple(faces))
