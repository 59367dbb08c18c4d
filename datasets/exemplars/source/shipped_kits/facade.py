"""A house front as one closed mesh without parts, an exemplar for shape grammars (symmetry §5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.solids import Color, Face, Point, Solid

BAY_COUNT, STOREY_COUNT = 5, 3
BAY_WIDTH, STOREY_HEIGHT = 1.2, 1.5
MARGIN_WIDTH, PLINTH_HEIGHT, CORNICE_HEIGHT = 0.45, 0.77, 0.525
"""Cuts next to a corner or a row of windows then run through plain wall."""
WALL_DEPTH = 0.8
WALL: Color = (214, 186, 150)
STONE: Color = (160, 152, 144)
GLASS: Color = (92, 118, 138)
WOOD: Color = (112, 74, 50)
ROOF: Color = (142, 92, 78)


@dataclass(frozen=True)
class _Block:
    """A box that is added to the house or removed from it, with the colour of its faces; later ones win."""

    low: Point
    high: Point
    solid: bool
    color: Color


def shapes() -> dict[str, KitShape]:
    """Return `townhouse`, a shape of one part."""
    shape = KitShape({"townhouse": _boundary(_blocks())})
    shape.put("townhouse", 0, 0, 0)
    return {"townhouse": shape}


def _blocks() -> list[_Block]:
    """Return the wall with plinth and cornice, recessed windows with sills, and a door in the middle."""
    width, height = (
        2 * MARGIN_WIDTH + BAY_COUNT * BAY_WIDTH,
        PLINTH_HEIGHT + STOREY_COUNT * STOREY_HEIGHT + CORNICE_HEIGHT,
    )
    blocks = [
        _Block((0, 0, 0), (width, height, WALL_DEPTH), True, WALL),
        _Block((-0.1, 0, -0.1), (width + 0.1, 0.4, WALL_DEPTH + 0.1), True, STONE),
        _Block((-0.15, height - 0.3, -0.15), (width + 0.15, height, WALL_DEPTH + 0.15), True, ROOF),
    ]
    for storey in range(STOREY_COUNT):
        for bay in range(BAY_COUNT):
            x, y = MARGIN_WIDTH + bay * BAY_WIDTH, PLINTH_HEIGHT + storey * STOREY_HEIGHT
            if storey == 0 and bay == BAY_COUNT // 2:
                blocks.append(_Block((x + 0.2, 0.4, WALL_DEPTH - 0.25), (x + 1.0, y + 1.25, WALL_DEPTH), False, WOOD))
                continue
            blocks.append(_Block((x + 0.25, y + 0.25, WALL_DEPTH - 0.2), (x + 0.95, y + 1.2, WALL_DEPTH), False, GLASS))
            blocks.append(_Block((x + 0.2, y + 0.15, WALL_DEPTH), (x + 1.0, y + 0.25, WALL_DEPTH + 0.1), True, STONE))
    return blocks


def _boundary(blocks: Sequence[_Block]) -> Solid:
    """Return the boundary of the combined blocks, as rectangles between the planes of all boxes."""
    ticks = [
        np.unique(np.round([block.low[d] for block in blocks] + [block.high[d] for block in blocks], 6))
        for d in range(3)
    ]
    middles = [(along[1:] + along[:-1]) / 2 for along in ticks]
    owner = np.full([len(along) + 2 for along in middles], -1)
    for number, block in enumerate(blocks):
        spans = [
            1 + np.flatnonzero((along > low) & (along < high))
            for along, low, high in zip(middles, block.low, block.high, strict=True)
        ]
        owner[np.ix_(*spans)] = number
    solid = np.array([*(block.solid for block in blocks), False])[owner]
    return _rectangles(ticks, solid, lambda inside, outside: _color(blocks, owner[inside], owner[outside]))


def _color(blocks: Sequence[_Block], inside: int, outside: int) -> Color:
    """Return the colour of the removed block that a face borders on, else that of its own block."""
    return blocks[outside].color if outside >= 0 and not blocks[outside].solid else blocks[inside].color


Cell = tuple[int, ...]


def _rectangles(ticks: Sequence[np.ndarray], solid: np.ndarray, color: Callable[[Cell, Cell], Color]) -> Solid:
    points: dict[Point, int] = {}
    faces: list[Face] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for cell in map(tuple, np.argwhere(solid).tolist()):
            for side in (0, 1):
                neighbour = list(cell)
                neighbour[axis] += 2 * side - 1
                if solid[tuple(neighbour)]:
                    continue
                corners = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0)):
                    at = [0.0, 0.0, 0.0]
                    at[axis] = float(ticks[axis][cell[axis] - 1 + side])
                    at[u], at[v] = float(ticks[u][cell[u] - 1 + du]), float(ticks[v][cell[v] - 1 + dv])
                    corners.append(points.setdefault((at[0], at[1], at[2]), len(points)))
                faces.append(Face((tuple(corners),), color(cell, tuple(neighbour))))
    return Solid(np.array(list(points)), tuple(faces))
