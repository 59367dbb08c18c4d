"""The fronts of a cabinet: doors, drawer fronts and their handles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stages.programs.curves import (
    Part,
    QuadMesh,
    bezier,
    circle,
    loft_rings,
    polyline,
    revolve,
    rotation,
    rounded_box,
    sweep,
    translation,
)
from stages.programs.library.cabinet_dimensions import FRONT_THICKNESS, CabinetDimensions, Opening, block
from stages.shape.arrays import FloatArray
from stages.shape.part_joint import PartJoint

PAINT, GLASS, STEEL, OAK = (226, 221, 208), (186, 206, 214), (78, 80, 84), (184, 150, 106)

FRONT_GAP = 0.002
"""Between fronts, and around those within the case, in metres."""

MAX_DOOR_RADIANS = np.pi / 2.0
"""By which a door opens."""

DRAWER_TRAVEL_SHARE = 0.8
"""By how much of the depth of the case a drawer comes out."""

MAX_DOOR_WIDTH = 0.55
"""A wider column has two doors; in metres."""

PANEL_DEPTH = 0.021
"""Of a panel, slats and glass within their frame, in metres."""
MOULDING_WIDTH = 0.008
"""Around a panel, in metres."""

HANDLE_DEPTH = 0.025
"""Depth of a handle's ends, in metres: deep enough for the panel within a frame."""

HALF_BAR_WIDTH = 0.007
"""Of a glazing bar, in metres."""
GLASS_OVERLAP = 0.004
"""Of glass and its frame, in metres."""

STYLE_SLAB, STYLE_FRAMED, STYLE_LOUVRED, STYLE_GLAZED = range(4)


def front_parts(cabinet: CabinetDimensions) -> list[Part]:
    """The fronts of every column that is not open."""
    return [
        part
        for column, is_open in zip(cabinet.columns, cabinet.is_open, strict=True)
        if not is_open
        for part in _column(cabinet, column)
    ]


def _column(cabinet: CabinetDimensions, column: Opening) -> list[Part]:
    """Drawers one above the other, a board, and one door or two."""
    values, rows = cabinet.values, cabinet.values["drawer_rows"]
    if rows == 0:
        return _doors(cabinet, column, column)
    width, height = column.size
    # A drawer is 10 to 34 cm high, and the doors keep a fifth of the column.
    min_stack, max_stack = min(0.1 * rows, 0.6 * height), min(0.34 * rows, 0.8 * height)
    stack = min_stack + (max_stack - min_stack) * values["drawer_share"]
    level = column.high[1] - stack if values["has_drawers_on_top"] else column.low[1] + stack
    below, above = column.split(level)
    half = min(cabinet.board, 0.02) / 2.0
    low = (column.low[0] - 0.004, level - half, cabinet.back + 0.01)
    parts = [
        Part("rail", block(low, (column.high[0] + 0.004, level + half, cabinet.front - FRONT_THICKNESS - 0.002)), OAK)
    ]
    drawers, doors = (above, below) if values["has_drawers_on_top"] else (below, above)
    for row in range(rows):
        bottom = drawers.low[1] + drawers.size[1] * row / rows
        piece = Opening((column.low[0], bottom), (column.high[0], bottom + drawers.size[1] / rows))
        leaf = _leaf(cabinet, column, piece)
        style = STYLE_SLAB if values["door_style"] == STYLE_SLAB else STYLE_FRAMED
        middle = (leaf.low[0] + leaf.high[0]) / 2.0, (leaf.low[1] + leaf.high[1]) / 2.0
        handle = _handle(cabinet, min(width, 0.6)).transformed(translation(*middle, cabinet.face))
        slide = PartJoint("prismatic", (0.0, 0.0, 1.0), (*middle, cabinet.face), DRAWER_TRAVEL_SHARE * values["depth"])
        drawer = [*_panel(cabinet, leaf, style, "drawer"), Part("handle", handle, STEEL)]
        parts += [part.on(slide) for part in drawer]
    return [*parts, *_doors(cabinet, column, doors)]


def _leaf(cabinet: CabinetDimensions, column: Opening, piece: Opening) -> Opening:
    """The outline of the front of a `piece` of a column: within its opening, or over half of the boards around."""
    if cabinet.values["has_inset_fronts"]:
        return piece.grown(-FRONT_GAP, -FRONT_GAP, -FRONT_GAP, -FRONT_GAP)
    left = cabinet.board if column is cabinet.columns[0] else cabinet.board / 2.0
    right = cabinet.board if column is cabinet.columns[-1] else cabinet.board / 2.0
    bottom = cabinet.board if piece.low[1] == column.low[1] else 0.0
    return piece.grown(left - FRONT_GAP / 2.0, bottom - FRONT_GAP / 2.0, right - FRONT_GAP / 2.0, -FRONT_GAP / 2.0)


def _doors(cabinet: CabinetDimensions, column: Opening, piece: Opening) -> list[Part]:
    """One door, or two that open from their middle."""
    leaf, values = _leaf(cabinet, column, piece), cabinet.values
    middle = (leaf.low[0] + leaf.high[0]) / 2.0
    pair = piece.size[0] > MAX_DOOR_WIDTH
    leaves = [leaf]
    if pair:
        leaves = [
            Opening(leaf.low, (middle - FRONT_GAP / 2, leaf.high[1])),
            Opening((middle + FRONT_GAP / 2, leaf.low[1]), leaf.high),
        ]
    parts = []
    height = leaf.size[1]
    length = _length(cabinet, min(height, 0.6))
    handle = _handle(cabinet, min(height, 0.6)).transformed(rotation("z", 90.0))
    reach = max(length, 0.3 * height) / 2.0 + 0.04 * height
    level = leaf.low[1] + reach + (height - 2.0 * reach) * values["handle_height"]
    for index, door in enumerate(leaves):
        panel = _panel(cabinet, door, values["door_style"], "door")
        side = max(_stile(door) / 2.0, min(0.03, 0.2 * door.size[0]))
        # Doors of a pair have their handles in the middle, single ones on the right.
        x = door.low[0] + side if pair and index == 1 else door.high[0] - side
        placed = Part("handle", handle.transformed(translation(x, level, cabinet.face)), STEEL)
        hinge = _hinge(cabinet, door, on_right=pair and index == 1)
        parts += [part.on(hinge) for part in (*panel, placed)]
    return parts


def _hinge(cabinet: CabinetDimensions, door: Opening, on_right: bool) -> PartJoint:
    """The hinge of a door that opens to the front: on an outer edge, so that the door clears the case."""
    x = door.high[0] if on_right else door.low[0]
    axis = (0.0, 1.0 if on_right else -1.0, 0.0)
    return PartJoint("revolute", axis, (x, door.low[1], cabinet.face), MAX_DOOR_RADIANS)


def _stile(leaf: Opening) -> float:
    """Width of a frame around a panel."""
    return min(0.06, 0.2 * min(leaf.size))


def _panel(cabinet: CabinetDimensions, leaf: Opening, style: int, label: str) -> list[Part]:
    """A door or drawer front: a slab, or a frame around a panel, slats or glass."""
    back, face = cabinet.face - FRONT_THICKNESS, cabinet.face
    # Fronts on the case touch it.
    back -= 0.0 if cabinet.values["has_inset_fronts"] else 0.0005
    if style == STYLE_SLAB:
        middle = [(leaf.low[0] + leaf.high[0]) / 2.0, (leaf.low[1] + leaf.high[1]) / 2.0, (back + face) / 2.0]
        radius = 0.4 * FRONT_THICKNESS * cabinet.values["edge_roundness"]
        return [Part(label, rounded_box([*leaf.size, face - back], radius, middle, steps=2), PAINT)]
    stile = _stile(leaf)
    inner = leaf.grown(-stile, -stile, -stile, -stile)
    deep = face - PANEL_DEPTH
    if style == STYLE_FRAMED:
        return [Part(label, _framed(leaf, inner, back, deep, face), PAINT)]
    if style == STYLE_LOUVRED:
        return [Part(label, _louvred(leaf, inner, back, deep, face), PAINT)]
    glass = inner.grown(GLASS_OVERLAP, GLASS_OVERLAP, GLASS_OVERLAP, GLASS_OVERLAP)
    pane = block((*glass.low, back + 0.002), (*glass.high, deep))
    return [Part(label, _glazed(leaf, inner, back, face), PAINT), Part("glass", pane, GLASS)]


def _corners(opening: Opening, z: float) -> FloatArray:
    """The corners of an opening at a depth, counter-clockwise seen from the front, float64 (4, 3)."""
    (left, bottom), (right, top) = opening.low, opening.high
    return np.array([(left, bottom, z), (right, bottom, z), (right, top, z), (left, top, z)])


def _framed(leaf: Opening, inner: Opening, back: float, deep: float, face: float) -> QuadMesh:
    """A panel at depth `deep` within a frame, between slanting mouldings."""
    panel = inner.grown(-MOULDING_WIDTH, -MOULDING_WIDTH, -MOULDING_WIDTH, -MOULDING_WIDTH)
    return loft_rings([_corners(leaf, back), _corners(leaf, face), _corners(inner, face), _corners(panel, deep)])


def _louvred(leaf: Opening, inner: Opening, back: float, deep: float, face: float) -> QuadMesh:
    """Slats in a frame, about five centimetres apart, each leaning from its nose at the face down to the next one's
    foot at depth `deep`."""
    count = max(2, round(inner.size[1] / 0.05))
    levels, sides = np.linspace(inner.low[1], inner.high[1], count + 1).tolist(), (inner.low[0], inner.high[0])
    noses = [(x, level, face) for level in levels for x in sides]
    feet = [(x, level, deep) for level in levels[1:] for x in sides]
    last = 8 + 2 * count
    quads = [
        *[(0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
        *[(4, 5, 9, 8), (6, 7, last, last + 1), (4, last, 7, 7), (6, 9, 5, 5)],
    ]
    for left in range(8, last, 2):
        right, above, beyond, foot, other = left + 1, left + 2, left + 3, left + 2 * count + 2, left + 2 * count + 3
        quads += [(4, left, above, above), (6, beyond, right, right)]
        quads += [(left, right, other, foot), (foot, other, beyond, above)]
        quads += [(left, foot, above, above), (right, beyond, other, other)]
    vertices = np.concatenate([_corners(leaf, back), _corners(leaf, face), noses, feet])
    return QuadMesh(vertices, np.array(quads, dtype=np.int32))


def _glazed(leaf: Opening, inner: Opening, back: float, face: float) -> QuadMesh:
    """A frame with glazing bars: a vertical one in a wide door, and horizontal ones about every forty centimetres."""
    (left, bottom), (right, top) = inner.low, inner.high
    verticals = [(left + right) / 2.0] if right - left > 0.34 else []
    horizontals = np.linspace(bottom, top, round((top - bottom) / 0.4) + 1)[1:-1].tolist()
    x = [
        leaf.low[0],
        left,
        *(bar + side for bar in verticals for side in (-HALF_BAR_WIDTH, HALF_BAR_WIDTH)),
        right,
        leaf.high[0],
    ]
    y = [
        leaf.low[1],
        bottom,
        *(bar + side for bar in horizontals for side in (-HALF_BAR_WIDTH, HALF_BAR_WIDTH)),
        top,
        leaf.high[1],
    ]
    return _grille(np.array(x), np.array(y), back, face)


def _grille(x: FloatArray, y: FloatArray, back: float, face: float) -> QuadMesh:
    """A plate from x[0] to x[-1] and y[0] to y[-1] with a hole in every other cell along both axes."""
    vertices = np.array([(across, level, z) for z in (back, face) for level in y for across in x])
    grid = np.arange(len(y) * len(x)).reshape(len(y), len(x))
    front = grid.size
    quads = []
    for row in range(len(y) - 1):
        for column in range(len(x) - 1):
            a, b, d, c = grid[row : row + 2, column : column + 2].ravel().tolist()
            if row % 2 == 0 or column % 2 == 0:
                quads += [(a, d, c, b), (front + a, front + b, front + c, front + d)]
            else:
                quads += [(p, front + p, front + q, q) for p, q in pairwise((a, b, c, d, a))]
    around = [*grid[0], *grid[1:, -1], *grid[-1, -2::-1], *grid[-2::-1, 0]]
    quads += [(p, q, front + q, front + p) for p, q in pairwise(around)]
    return QuadMesh(vertices, np.array(quads, dtype=np.int32))


def _length(cabinet: CabinetDimensions, room: float) -> float:
    """The length of a handle in a space of length `room`."""
    return float((0.25 + 0.4 * cabinet.values["handle_size"]) * room)


def _handle(cabinet: CabinetDimensions, room: float) -> QuadMesh:
    """A handle along x on the plane z = 0 with its ends in the front: a knob, a bar with bent ends, or a bow."""
    kind, half = cabinet.values["handle_type"], _length(cabinet, room) / 2.0
    if kind == 0:
        radius = (0.009 + 0.01 * cabinet.values["handle_size"]) * min(1.0, room / 0.11)
        # A ball on a stem of a little less than half its thickness, in one outline.
        turn = np.linspace(np.arcsin(0.45), np.pi, 8)
        outline = np.stack([radius * np.sin(turn), 0.02 - 0.7 * radius * np.cos(turn)], axis=1)
        knob = revolve(polyline(np.concatenate([[[0.45 * radius, -HANDLE_DEPTH]], outline])), count=12)
        return knob.transformed(rotation("x", 90.0))
    # Short handles are thin, or they could not bend.
    thick, rise = min(0.005, 0.2 * half), min(0.045, 1.5 * half)
    if kind == 1:
        bar = polyline(
            [(-half, 0.0, -HANDLE_DEPTH), (-half, 0.0, 0.028), (half, 0.0, 0.028), (half, 0.0, -HANDLE_DEPTH)]
        )
        return sweep(bar, circle(thick, 8), up=(0.0, 1.0, 0.0))
    bow = bezier(
        [(-half, 0.0, -HANDLE_DEPTH), (-0.9 * half, 0.0, rise), (0.9 * half, 0.0, rise), (half, 0.0, -HANDLE_DEPTH)], 12
    )
    return sweep(bow, circle(thick, 8), up=(0.0, 1.0, 0.0))
