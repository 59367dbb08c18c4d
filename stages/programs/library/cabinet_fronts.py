"""What closes a cabinet: doors, drawer fronts and their handles."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import (
    Part,
    QuadMesh,
    bezier,
    box,
    circle,
    ellipsoid,
    line,
    rotation,
    rounded_box,
    sweep,
    translation,
)
from stages.programs.library.cabinet_dimensions import FRONT, CabinetDimensions, Opening, block

__all__ = ["front_parts"]

PAINT, GLASS, STEEL, OAK = (226, 221, 208), (186, 206, 214), (78, 80, 84), (184, 150, 106)

GAP = 0.002
"""Air between fronts, and around those that lie within the case."""

WIDEST = 0.55
"""A wider column has two doors."""

ROOT = 0.014
"""How deep handles are sunk: they reach the panel within a frame, too."""

SLAB, FRAMED, LOUVRED, GLAZED = range(4)


def front_parts(cabinet: CabinetDimensions) -> list[Part]:
    """The fronts of every column that is not open."""
    return [
        part
        for column, bare in zip(cabinet.columns, cabinet.is_open, strict=True)
        if not bare
        for part in _column(cabinet, column)
    ]


def _column(cabinet: CabinetDimensions, column: Opening) -> list[Part]:
    """Drawers one above the other, a board, and one door or two."""
    values, rows = cabinet.values, cabinet.values["drawer_rows"]
    if rows == 0:
        return _doors(cabinet, column, column)
    width, height = column.size
    # A drawer is as high as a hand and no higher than an arm is long; the doors keep a fifth of the column.
    least, most = min(0.1 * rows, 0.6 * height), min(0.34 * rows, 0.8 * height)
    stack = least + (most - least) * values["drawer_share"]
    level = column.high[1] - stack if values["has_drawers_on_top"] else column.low[1] + stack
    below, above = column.split(level)
    half = min(cabinet.board, 0.02) / 2.0
    low = (column.low[0] - 0.004, level - half, cabinet.back + 0.01)
    parts = [Part("rail", block(low, (column.high[0] + 0.004, level + half, cabinet.front - FRONT - 0.002)), OAK)]
    drawers, doors = (above, below) if values["has_drawers_on_top"] else (below, above)
    for row in range(rows):
        bottom = drawers.low[1] + drawers.size[1] * row / rows
        piece = Opening((column.low[0], bottom), (column.high[0], bottom + drawers.size[1] / rows))
        leaf = _leaf(cabinet, column, piece)
        style = SLAB if values["door_style"] == SLAB else FRAMED
        middle = (leaf.low[0] + leaf.high[0]) / 2.0, (leaf.low[1] + leaf.high[1]) / 2.0
        parts += _panel(cabinet, leaf, style, "drawer")
        handle = _handle(cabinet, min(width, 0.6))
        parts.append(Part("handle", handle.transformed(translation(*middle, cabinet.face)), STEEL))
    return [*parts, *_doors(cabinet, column, doors)]


def _leaf(cabinet: CabinetDimensions, column: Opening, piece: Opening) -> Opening:
    """What the front of a `piece` of a column covers: its opening, or half of the boards around it, too."""
    if cabinet.values["has_inset_fronts"]:
        return piece.grown(-GAP, -GAP, -GAP, -GAP)
    left = cabinet.board if column is cabinet.columns[0] else cabinet.board / 2.0
    right = cabinet.board if column is cabinet.columns[-1] else cabinet.board / 2.0
    bottom = cabinet.board if piece.low[1] == column.low[1] else 0.0
    return piece.grown(left - GAP / 2.0, bottom - GAP / 2.0, right - GAP / 2.0, -GAP / 2.0)


def _doors(cabinet: CabinetDimensions, column: Opening, piece: Opening) -> list[Part]:
    """One door, or two that open from their middle."""
    leaf, values = _leaf(cabinet, column, piece), cabinet.values
    middle = (leaf.low[0] + leaf.high[0]) / 2.0
    pair = piece.size[0] > WIDEST
    leaves = [leaf]
    if pair:
        leaves = [
            Opening(leaf.low, (middle - GAP / 2, leaf.high[1])),
            Opening((middle + GAP / 2, leaf.low[1]), leaf.high),
        ]
    parts = []
    height = leaf.size[1]
    length = _length(cabinet, min(height, 0.6))
    handle = _handle(cabinet, min(height, 0.6)).transformed(rotation("z", 90.0))
    reach = max(length, 0.3 * height) / 2.0 + 0.04 * height
    level = leaf.low[1] + reach + (height - 2.0 * reach) * values["handle_height"]
    for place, each in enumerate(leaves):
        parts += _panel(cabinet, each, values["door_style"], "door")
        side = max(_stile(each) / 2.0, min(0.03, 0.2 * each.size[0]))
        # Doors of a pair are gripped in the middle, single ones on the right.
        x = each.low[0] + side if pair and place == 1 else each.high[0] - side
        parts.append(Part("handle", handle.transformed(translation(x, level, cabinet.face)), STEEL))
    return parts


def _stile(leaf: Opening) -> float:
    """Width of a frame around a panel."""
    return min(0.06, 0.2 * min(leaf.size))


def _panel(cabinet: CabinetDimensions, leaf: Opening, style: int, label: str) -> list[Part]:
    """A door or drawer front: a slab, or a frame around a panel, slats or glass."""
    back, face = cabinet.face - FRONT, cabinet.face
    # Fronts on the case touch it.
    back -= 0.0 if cabinet.values["has_inset_fronts"] else 0.0005
    if style == SLAB:
        middle = [(leaf.low[0] + leaf.high[0]) / 2.0, (leaf.low[1] + leaf.high[1]) / 2.0, (back + face) / 2.0]
        radius = 0.4 * FRONT * cabinet.values["edge_roundness"]
        return [Part(label, rounded_box([*leaf.size, face - back], radius, middle, steps=2), PAINT)]
    stile = _stile(leaf)
    (left, bottom), (right, top) = leaf.low, leaf.high
    frame = [
        block((left, bottom, back), (left + stile, top, face)),
        block((right - stile, bottom, back), (right, top, face)),
        block((left + stile, bottom, back), (right - stile, bottom + stile, face - 0.0005)),
        block((left + stile, top - stile, back), (right - stile, top, face - 0.0005)),
    ]
    inner = leaf.grown(0.004 - stile, 0.004 - stile, 0.004 - stile, 0.004 - stile)
    third = (face - back) / 3.0
    if style == LOUVRED:
        return [Part(label, QuadMesh.joined([*frame, *_slats(inner, back, face)]), PAINT)]
    pane = block((*inner.low, back + 0.4 * third), (*inner.high, back + 1.4 * third))
    if style == FRAMED:
        return [Part(label, QuadMesh.joined([*frame, pane]), PAINT)]
    return [Part(label, QuadMesh.joined([*frame, *_bars(inner, back, face)]), PAINT), Part("glass", pane, GLASS)]


def _slats(inner: Opening, back: float, face: float) -> list[QuadMesh]:
    """Slanting slats, about five centimetres apart."""
    width, height = inner.size
    count = max(2, round(height / 0.05))
    depth, step = 0.8 * (face - back), height / count
    slat = box([width, 1.05 * step, 0.006]).transformed(rotation("x", -_lean(step, depth)))
    x, z = (inner.low[0] + inner.high[0]) / 2.0, (back + face) / 2.0
    return [slat.transformed(translation(x, inner.low[1] + (row + 0.5) * step, z)) for row in range(count)]


def _lean(step: float, depth: float) -> float:
    """How far slats lean, in degrees, to stay within a depth."""
    return float(np.degrees(np.arcsin(min(0.7, (depth - 0.006) / (1.05 * step)))))


def _bars(inner: Opening, back: float, face: float) -> list[QuadMesh]:
    """Glazing bars: one upright in a wide door, and level ones about every forty centimetres."""
    (left, bottom), (right, top) = inner.low, inner.high
    near, thick = back + 0.25 * (face - back), 0.007
    middle = (left + right) / 2.0
    levels = np.linspace(bottom, top, round((top - bottom) / 0.4) + 1)[1:-1].tolist()
    bars = [block((left, level - thick, near), (right, level + thick, face - 0.003)) for level in levels]
    if right - left > 0.34:
        bars.append(block((middle - thick, bottom, near), (middle + thick, top, face - 0.002)))
    return bars


def _length(cabinet: CabinetDimensions, room: float) -> float:
    """How long a handle is where it has `room`."""
    return float((0.25 + 0.4 * cabinet.values["handle_size"]) * room)


def _handle(cabinet: CabinetDimensions, room: float) -> QuadMesh:
    """A handle along x on the plane z = 0, its feet sunk into the front: a knob, a bar on posts, or a bow."""
    kind, half = cabinet.values["handle_type"], _length(cabinet, room) / 2.0
    if kind == 0:
        radius = (0.009 + 0.01 * cabinet.values["handle_size"]) * min(1.0, room / 0.11)
        stem = sweep(line((0.0, 0.0, -ROOT), (0.0, 0.0, 0.02)), circle(0.45 * radius, 8))
        return QuadMesh.joined([stem, ellipsoid((radius, radius, 0.7 * radius), (0.0, 0.0, 0.02), count=12)])
    # What is short is thin, or it would not bend.
    thick, rise = min(0.005, 0.2 * half), min(0.045, 1.5 * half)
    if kind == 1:
        post = 0.75 * half
        bar = sweep(line((-half, 0.0, 0.028), (half, 0.0, 0.028)), circle(thick, 8))
        posts = [sweep(line((x, 0.0, -ROOT), (x, 0.0, 0.028)), circle(0.8 * thick, 8)) for x in (-post, post)]
        return QuadMesh.joined([bar, *posts])
    bow = bezier([(-half, 0.0, -ROOT), (-0.9 * half, 0.0, rise), (0.9 * half, 0.0, rise), (half, 0.0, -ROOT)], 12)
    return sweep(bow, circle(thick, 8), up=(0.0, 1.0, 0.0))
