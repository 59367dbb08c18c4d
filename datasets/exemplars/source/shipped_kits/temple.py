"""The temple precinct: columns on a square lattice, each bay closed by a stylobate span below and a beam above.

The distance of columns is 3.0. Every bay is a cycle of four parts. A cell of four bays may have a floor. Its
roof is a gable that continues in the next cell, a dome, or a second storey. Roofs rest on beams alone and clear the
columns, so that a roof does not depend on its surroundings.
"""

from __future__ import annotations

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.outlines import arch, chamfered, mirrored, rectangle, regular
from shipped_kits.solids import Color, Solid, box, extruded, joined, loft, revolved, stacked
from stages.shape.arrays import FloatArray

COLUMN_SPACING = 3.0
JOINT_OVERLAP = 0.03
"""Depth of a part inside the part that it is joined to."""
COLUMN_HEIGHT = 4.0
BEAM_TOP = 4.08
"""Height of the top of a beam, which carries roofs, domes and balustrades."""
UPPER_COLUMN_HEIGHT = 3.0

MARBLE, MARBLE_WARM, MARBLE_SHADE = (240, 234, 222), (228, 216, 196), (203, 189, 168)
TILE, TILE_DARK, GOLD, BRONZE = (201, 108, 78), (172, 86, 62), (226, 180, 86), (150, 112, 70)
BLUE, BLUE_DARK, RED, WATER = (86, 132, 172), (62, 100, 140), (184, 76, 64), (104, 178, 196)
FLAME, SHADOW = (244, 150, 62), (96, 84, 82)


def shapes() -> dict[str, KitShape]:
    """Return the two example precincts by name."""
    return {"peripteros": _peripteros(), "stoa": _stoa()}


def _types() -> dict[str, Solid]:
    return {
        "column": _column(),
        "column_upper": _column_upper(),
        "span": _span(),
        "beam": _beam(),
        "balustrade": _balustrade(),
        "screen": _screen(),
        "portal": _portal(),
        "roof": _roof(),
        "pediment": _pediment(),
        "acroterion": _acroterion(),
        "dome": _dome(),
        "finial": _finial(),
        "floor": _floor(),
        "pool": _pool(),
        "statue": _statue(),
        "stairs": _stairs(),
        "path": _path(),
        "altar": _altar(),
    }


def _fluted(levels: list[tuple[float, float]], flutes: int, color: Color) -> Solid:
    """A fluted shaft: radius and height of each level."""
    angles = np.pi * (np.arange(2 * flutes) + 0.5) / flutes
    depth = np.where(np.arange(2 * flutes) % 2, 1.0, 0.86)
    ring = np.stack([np.cos(angles) * depth, np.zeros(2 * flutes), -np.sin(angles) * depth], axis=1)
    return loft([ring * radius + [0.0, height, 0.0] for radius, height in levels], color)


def _column() -> Solid:
    foot = stacked(rectangle(1.0, 1.0), [(0.0, 0.0), (0.0, 0.32), (-0.04, 0.36)], MARBLE_WARM)
    base = revolved([(0.38, 0.34), (0.44, 0.4), (0.44, 0.48), (0.38, 0.54)], 12, MARBLE)
    shaft = _fluted([(0.38, 0.52), (0.37, 1.5), (0.31, 3.1)], 12, MARBLE)
    neck = revolved([(0.3, 3.06), (0.33, 3.1), (0.33, 3.14), (0.43, 3.28)], 12, [GOLD, GOLD, MARBLE])
    abacus = box((0.92, 0.15, 0.92), (0.0, 3.27, 0.0), MARBLE_WARM)
    head = stacked(rectangle(0.8, 0.8), [(0.0, 3.4), (0.0, 3.94), (-0.06, COLUMN_HEIGHT)], MARBLE)
    head = head.inset((0.4, 3.68, 0.0), rectangle(0.5, 0.34), -0.03, MARBLE_WARM, BLUE, shrink=0.02, copies=4)
    return foot + base + shaft + neck + abacus + head


def _column_upper() -> Solid:
    """Stands on the head of a column; its own head is as wide, so the same beams fit."""
    foot = stacked(rectangle(0.68, 0.68), [(0.0, 0.0), (0.0, 0.62), (-0.04, 0.66)], MARBLE_WARM)
    foot = foot.inset((0.34, 0.34, 0.0), rectangle(0.4, 0.3), -0.02, MARBLE, RED, shrink=0.02, copies=4)
    shaft = _fluted([(0.27, 0.64), (0.26, 1.2), (0.22, 2.24)], 8, MARBLE)
    bell = revolved([(0.21, 2.2), (0.24, 2.24), (0.24, 2.28), (0.34, 2.42)], 8, [GOLD, GOLD, MARBLE])
    head = stacked(rectangle(0.8, 0.8), [(-0.02, 2.4), (0.0, 2.46), (0.0, 2.94), (-0.06, UPPER_COLUMN_HEIGHT)], MARBLE)
    head = head.inset((0.4, 2.7, 0.0), rectangle(0.5, 0.3), -0.03, MARBLE_WARM, BLUE, shrink=0.02, copies=4)
    return foot + shaft + bell + head


def _span() -> Solid:
    """Lies along x between the feet of two columns."""
    half = COLUMN_SPACING / 2 - 0.5 + JOINT_OVERLAP
    section = mirrored((0.4, 0.0), (0.4, 0.16), (0.36, 0.2), (0.36, 0.32), (0.32, 0.36))
    span = extruded(section, -half, half, MARBLE_WARM).rotated(90.0)
    for x in (-0.5, 0.5):
        span = span.inset((x, 0.08, 0.4), rectangle(0.03, 0.15), 0.03, MARBLE_SHADE, copies=2)
    return span


def _beam() -> Solid:
    """Lies along x between the heads of two columns; its own foot is at the height of their abacus."""
    half = COLUMN_SPACING / 2 - 0.4 + JOINT_OVERLAP
    frieze, cornice = ((0.25, 0.0), (0.25, 0.2), (0.28, 0.22)), ((0.32, 0.58), (0.32, 0.63), (0.29, 0.66))
    lintel = mirrored(*frieze, (0.28, 0.54), *cornice)
    beam = extruded(lintel, -half, half, MARBLE).rotated(90.0)
    for x in (-0.8, -0.4, 0.0, 0.4, 0.8):
        beam = beam.inset((x, 0.38, 0.28), rectangle(0.2, 0.26), -0.03, MARBLE_WARM, BLUE, shrink=0.02, copies=2)
    return beam


def _balustrade() -> Solid:
    """Rests on a beam, between the feet of two upper columns."""
    half = COLUMN_SPACING / 2 - 0.34 + JOINT_OVERLAP
    foot = box((2 * half, 0.12, 0.36), (0.0, 0.0, 0.0), MARBLE_WARM)
    rail = box((2 * half, 0.12, 0.3), (0.0, 0.44, 0.0), MARBLE, 0.03)
    baluster = revolved([(0.07, 0.1), (0.1, 0.2), (0.05, 0.36), (0.08, 0.46)], 6, MARBLE)
    for x in (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9):
        foot = foot + baluster.translated(x)
    return foot + rail


def _screen() -> Solid:
    """A wall that closes a bay: it stands on the span and reaches the beam, clear of the columns."""
    wall = box((1.84, 3.06, 0.3), (0.0, 0.0, 0.0), MARBLE_WARM)
    for side in (0.0, 180.0):
        wall = wall.rotated(side)
        wall = wall.inset((0.0, 0.44, 0.15), rectangle(1.6, 0.6), -0.05, MARBLE_SHADE, RED, shrink=0.03)
        wall = wall.inset((0.0, 1.96, 0.15), rectangle(0.9, 1.5), -0.05, MARBLE)
        wall = wall.inset((0.0, 1.96, 0.2), rectangle(0.7, 1.3), 0.1, MARBLE_SHADE, SHADOW)
    for x in (-0.175, 0.0, 0.175):
        wall = wall + box((0.05, 1.36, 0.3), (x, 1.28, 0.0), BRONZE)
    return wall


def _portal() -> Solid:
    """A doorway that closes a bay."""
    outline = [*mirrored((0.46, 0.0), (0.92, 0.0), (0.92, 3.06)), (-0.46, 2.2), (0.46, 2.2)]
    lintel = mirrored((0.8, -0.28), (0.8, -0.12), (0.0, 0.24))[[0, 1, 2, 4, 5]]
    frame = extruded(np.array(outline), -0.15, 0.15, MARBLE_WARM)
    for side in (0.0, 180.0):
        frame = frame.rotated(side)
        for x in (-0.62, 0.62):
            frame = frame.inset((x, 1.12, 0.15), rectangle(0.24, 2.16), -0.06, MARBLE, shrink=0.02)
        frame = frame.inset((0.0, 2.62, 0.15), lintel, -0.08, MARBLE, BLUE, shrink=0.05)
    for x in (-0.42, 0.42):
        frame = frame + box((0.08, 2.1, 0.42), (x, 0.04, 0.16), BRONZE)
    return frame


def _gable(reach: float, eave: float, ridge: float) -> FloatArray:
    """The outline of a roof: it touches at height 0 between 1.2 and 1.46 from its middle and is clear of all else."""
    outside = mirrored((1.46, 0.0), (1.52, 0.12), (reach, 0.12), (reach, eave), (0.1, ridge))
    return np.concatenate([outside, [(-1.2, 0.0), (-1.14, 0.16), (0.0, 0.7), (1.14, 0.16), (1.2, 0.0)]])


def _roof() -> Solid:
    """Covers one cell, ridge along x; rests on the beams at z = -1.5 and z = 1.5 and ends flush with the cell."""
    half = COLUMN_SPACING / 2
    vault = extruded(_gable(2.05, 0.24, 1.28), -half, half, TILE).rotated(90.0)
    slope = np.hypot(1.95, 1.04)
    for x in (-1.2, -0.6, 0.0, 0.6, 1.2):
        rib = rectangle(0.12, slope - 0.16)
        vault = vault.inset((x, 0.76, 1.075), rib, -0.07, TILE, TILE_DARK, shrink=0.025)
        vault = vault.inset((x, 0.76, -1.075), rib, -0.07, TILE, TILE_DARK, shrink=0.025)
    ridge = box((2 * half, 0.14, 0.24), (0.0, 1.22, 0.0), TILE_DARK, 0.04)
    return vault + ridge


def _pediment() -> Solid:
    """Closes a roof: its back is the plane z = 0, at the end of the roof; it rests on the beam below."""
    outline = mirrored((1.05, 0.0), (1.1, 0.12), (2.12, 0.12), (2.12, 0.3), (0.04, 1.42))
    front = extruded(outline, 0.0, 0.36, MARBLE)
    triangle = np.array([(-1.5, 0.0), (1.5, 0.0), (0.0, 0.8)])
    front = front.inset((0.0, 0.26, 0.36), triangle, 0.1, MARBLE_SHADE, BLUE_DARK)
    front = front.inset((0.0, 0.56, 0.26), regular(8, 0.2), -0.07, GOLD, shrink=0.04)
    for x in (-0.58, 0.58):
        front = front.inset((x, 0.4, 0.26), regular(6, 0.11), -0.05, MARBLE_WARM, GOLD, shrink=0.03)
    return front


def _acroterion() -> Solid:
    """A palmette on the tip of a pediment."""
    low, high = ((0.06, 0.1), (0.14, 0.14), (0.34, 0.3), (0.26, 0.36)), ((0.3, 0.52), (0.18, 0.52), (0.12, 0.68))
    palm = mirrored(*low, *high, (0.03, 0.78))
    plate = extruded(palm, -0.06, 0.06, GOLD).inset((0.0, 0.4, 0.06), regular(6, 0.1), -0.04, BRONZE, shrink=0.03)
    return box((0.3, 0.24, 0.26), (0.0, -0.08, 0.0), MARBLE, 0.03) + plate


def _dome() -> Solid:
    """Covers one cell and rests on the beams of its four bays."""
    slab = stacked(chamfered(2.84, 2.84, 0.6), [(0.0, 0.0), (0.0, 0.16), (-0.12, 0.22)], [MARBLE, MARBLE_WARM])
    drum = revolved([(1.12, 0.2), (1.12, 0.86), (1.2, 0.92), (1.2, 1.04)], 12, [MARBLE, MARBLE_WARM, MARBLE])
    window = arch(0.26, 0.5, 0.12, 4, y=-0.26)
    drum = drum.inset((1.12, 0.54, 0.0), window, 0.1, MARBLE_SHADE, BLUE_DARK, copies=12)
    angles = np.radians([0.0, 22.0, 44.0, 64.0])
    cap = [(1.12 * float(np.cos(a)), 1.02 + 1.02 * float(np.sin(a))) for a in angles]
    shell = revolved([*cap, (0.16, 2.02), (0.16, 2.1)], 12, [BLUE, BLUE, BLUE, BLUE_DARK, GOLD])
    return slab + drum + shell


def _finial() -> Solid:
    """A gilt ornament on the top of a dome."""
    foot = [(0.2, 0.0), (0.2, 0.05), (0.07, 0.12), (0.07, 0.2)]
    return revolved([*foot, (0.17, 0.3), (0.17, 0.4), (0.05, 0.5), (0.0, 0.92)], 8, GOLD)


def _floor() -> Solid:
    """The floor of a cell, reaching the spans of its four bays but not the feet of the columns."""
    tile = stacked(chamfered(2.28, 2.28, 0.42), [(0.0, 0.06), (0.0, 0.26)], MARBLE_WARM)
    tile = tile.inset((0.0, 0.26, 0.0), chamfered(1.9, 1.9, 0.36), -0.02, MARBLE_SHADE, RED)
    tile = tile.inset((0.0, 0.28, 0.0), chamfered(1.6, 1.6, 0.3), -0.02, MARBLE, MARBLE)
    return tile.inset((0.0, 0.3, 0.0), regular(8, 0.46), -0.02, GOLD, BLUE)


def _pool() -> Solid:
    """A basin in place of a floor."""
    tile = stacked(chamfered(2.28, 2.28, 0.42), [(0.0, 0.06), (0.0, 0.3)], MARBLE_WARM)
    tile = tile.inset((0.0, 0.3, 0.0), chamfered(1.7, 1.7, 0.4), -0.12, MARBLE, MARBLE)
    tile = tile.inset((0.0, 0.42, 0.0), chamfered(1.46, 1.46, 0.35), 0.1, BLUE_DARK, WATER)
    foot = [(0.3, 0.3), (0.24, 0.44), (0.1, 0.5), (0.08, 0.8), (0.34, 0.94), (0.34, 1.0)]
    colors = [MARBLE, MARBLE, MARBLE_WARM, MARBLE, MARBLE, WATER, WATER, WATER]
    return tile + revolved([*foot, (0.12, 1.0), (0.06, 1.3), (0.0, 1.34)], 8, colors)


def _statue() -> Solid:
    """A gilt figure with a spear on a pedestal, in the middle of a floor."""
    levels = [(0.06, 0.0), (0.06, 0.1), (0.0, 0.14), (0.0, 0.52), (0.06, 0.58), (0.06, 0.66)]
    pedestal = stacked(rectangle(0.76, 0.76), levels, MARBLE)
    pedestal = pedestal.inset((0.0, 0.33, 0.38), rectangle(0.48, 0.24), 0.03, MARBLE_SHADE, RED)
    profile = [(0.26, 0.64), (0.2, 1.1), (0.15, 1.4), (0.22, 1.7), (0.2, 1.82), (0.07, 1.9)]
    robe = revolved(profile, 8, [GOLD, GOLD, BRONZE, GOLD, GOLD])
    head = revolved([(0.06, 1.86), (0.13, 1.98), (0.12, 2.12), (0.0, 2.24)], 8, GOLD)
    plume = np.array([(-0.16, 2.0), (0.02, 2.2), (0.14, 2.2), (0.12, 2.34), (-0.08, 2.36), (-0.2, 2.2)])
    crest = extruded(plume, -0.03, 0.03, RED).rotated(90.0)
    spear = revolved([(0.025, 0.64), (0.025, 2.3), (0.06, 2.34), (0.0, 2.56)], 5, BRONZE).translated(0.27, 0.0, 0.12)
    shield = (
        revolved([(0.22, 0.0), (0.22, 0.05), (0.0, 0.1)], 10, BRONZE).rotated(90.0, "x").translated(-0.2, 1.3, 0.18)
    )
    arm = box((0.16, 0.12, 0.2), (0.23, 1.56, 0.1), GOLD)
    return joined(pedestal, robe, head, crest, spear, shield, arm)


def _stairs() -> Solid:
    """Leads up to a span: its face is the plane z = 0, the stairs come down towards positive z."""
    treads = [(-0.14 * k, 0.32 - 0.08 * (k - side)) for k in (1, 2, 3) for side in (1, 0)]
    outline = [(JOINT_OVERLAP, 0.0), (JOINT_OVERLAP, 0.32), *treads, (-0.6, 0.08), (-0.6, 0.0)]
    flight = extruded(np.array(outline), -0.58, 0.58, MARBLE).rotated(90.0)
    cheek = box((0.2, 0.42, 0.52), (0.67, 0.0, 0.25), MARBLE_WARM, 0.03)
    return flight + cheek + cheek.translated(-1.34)


def _path() -> Solid:
    """A paving slab of the way between two flights of stairs."""
    slab = stacked(chamfered(1.0, 1.0, 0.18), [(0.0, 0.0), (0.0, 0.06), (-0.04, 0.1)], MARBLE_SHADE)
    return slab.inset((0.0, 0.1, 0.0), chamfered(0.7, 0.7, 0.2), -0.02, MARBLE_WARM, MARBLE_WARM)


def _altar() -> Solid:
    """Build a fire bowl on a round step, at the end of a path; its slab docks like a paving slab."""
    slab = stacked(chamfered(1.0, 1.0, 0.18), [(0.0, 0.0), (0.0, 0.06), (-0.04, 0.1)], MARBLE_SHADE)
    step = revolved([(0.4, 0.08), (0.4, 0.2), (0.3, 0.2), (0.3, 0.32)], 12, MARBLE)
    profile = [(0.2, 0.3), (0.2, 0.38), (0.07, 0.46), (0.07, 0.82), (0.26, 1.0), (0.28, 1.1), (0.22, 1.1), (0.18, 1.02)]
    bowl = revolved(profile, 8, [BRONZE] * 5 + [GOLD, SHADOW])
    flame = revolved([(0.15, 0.98), (0.19, 1.18), (0.09, 1.42), (0.0, 1.68)], 8, [RED, FLAME, GOLD])
    return joined(slab, step, bowl, flame)


class _Precinct(KitShape):
    """Places temple parts by lattice coordinates: the column (i, j) is at x = 3 i, z = 3 j."""

    def __init__(self) -> None:
        super().__init__(_types())

    def column(self, i: float, j: float) -> None:
        """Place a column of the ground storey."""
        self.put("column", COLUMN_SPACING * i, 0.0, COLUMN_SPACING * j)

    def bay(self, i: float, j: float, k: float, m: float, between: str = "") -> None:
        """Place the span and the beam between two neighbouring columns, and what closes the bay, if anything."""
        x, z, turn = COLUMN_SPACING * (i + k) / 2, COLUMN_SPACING * (j + m) / 2, 0.0 if j == m else 90.0
        self.put("span", x, 0.0, z, turn)
        self.put("beam", x, BEAM_TOP - 0.66, z, turn)
        if between:
            self.put(between, x, 0.36, z, turn)

    def storey(self, i: int, j: int, level: int) -> None:
        """Place an upper storey over the cell (i, j): four columns, four balustrades, four beams."""
        foot = COLUMN_HEIGHT + UPPER_COLUMN_HEIGHT * (level - 1)
        for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
            self.put("column_upper", COLUMN_SPACING * a, foot, COLUMN_SPACING * b)
        for x, z, turn in ((i + 0.5, j, 0.0), (i + 1, j + 0.5, 90.0), (i + 0.5, j + 1, 0.0), (i, j + 0.5, 90.0)):
            self.put("balustrade", COLUMN_SPACING * x, foot + BEAM_TOP - COLUMN_HEIGHT, COLUMN_SPACING * z, turn)
            self.put(
                "beam",
                COLUMN_SPACING * x,
                foot + UPPER_COLUMN_HEIGHT + BEAM_TOP - COLUMN_HEIGHT - 0.66,
                COLUMN_SPACING * z,
                turn,
            )

    def cell(self, name: str, i: int, j: int, height: float = 0.0, turn: float = 0.0) -> None:
        """Place a floor, pool, dome or roof in the cell between the columns (i, j) and (i + 1, j + 1)."""
        self.put(name, COLUMN_SPACING * (i + 0.5), height, COLUMN_SPACING * (j + 0.5), turn)

    def gable(self, x: float, z: float, turn: float, height: float = BEAM_TOP) -> None:
        """Place a pediment with its back at (x, z), facing `turn`, and its palmette."""
        self.put("pediment", x, height, z, turn)
        outward = np.radians(turn)
        self.put("acroterion", x + 0.18 * float(np.sin(outward)), height + 1.4, z + 0.18 * float(np.cos(outward)), turn)


def _peripteros() -> KitShape:
    """Build a long hall with a gabled roof, a court with a pool next to it, and a way to a domed belvedere."""
    precinct = _Precinct()
    for j in range(4):
        precinct.column(0, j)
        precinct.column(1, j)
    for i, j in ((2, 1), (2, 2), (3, 1), (4, 1), (3, 2), (4, 2), (2, 3)):
        precinct.column(i, j)
    precinct.bay(0, 0, 1, 0)
    precinct.bay(0, 1, 1, 1)
    precinct.bay(0, 2, 1, 2)
    precinct.bay(0, 3, 1, 3, "portal")
    for j, left, right in ((0, "screen", "screen"), (1, "screen", ""), (2, "screen", "screen")):
        precinct.bay(0, j, 0, j + 1, left)
        precinct.bay(1, j, 1, j + 1, right)
        precinct.cell("floor", 0, j)
        precinct.cell("roof", 0, j, BEAM_TOP, 90.0)
    precinct.gable(1.5, 0.0, 180.0)
    precinct.gable(1.5, 9.0, 0.0)
    precinct.put("statue", 1.5, 0.3, 1.5)
    precinct.bay(1, 1, 2, 1)
    precinct.bay(1, 2, 2, 2)
    precinct.bay(2, 1, 2, 2)
    precinct.cell("pool", 1, 1)
    precinct.bay(2, 2, 2, 3)
    precinct.bay(2, 1, 3, 1)
    precinct.bay(3, 1, 4, 1)
    precinct.bay(3, 2, 4, 2)
    precinct.bay(3, 1, 3, 2)
    precinct.bay(4, 1, 4, 2)
    precinct.cell("floor", 3, 1)
    precinct.storey(3, 1, 1)
    precinct.cell("dome", 3, 1, BEAM_TOP + UPPER_COLUMN_HEIGHT)
    precinct.put("finial", 10.5, BEAM_TOP + UPPER_COLUMN_HEIGHT + 2.08, 4.5)
    precinct.put("stairs", 1.5, 0.0, 9.4)
    precinct.put("path", 1.5, 0.0, 10.5)
    precinct.put("altar", 1.5, 0.0, 11.5)
    precinct.put("stairs", 12.4, 0.0, 4.5, 90.0)
    return precinct


def _stoa() -> KitShape:
    """Build a tower of three storeys and a small temple, joined by colonnades around an open court."""
    precinct = _Precinct()
    for i in range(5):
        for j in range(3):
            if (i, j) not in ((0, 2), (2, 1)):
                precinct.column(i, j)
    precinct.bay(0, 0, 1, 0)
    precinct.bay(0, 0, 0, 1)
    precinct.bay(1, 0, 1, 1)
    precinct.bay(0, 1, 1, 1)
    precinct.storey(0, 0, 1)
    precinct.storey(0, 0, 2)
    precinct.cell("floor", 0, 0)
    precinct.cell("dome", 0, 0, BEAM_TOP + 2 * UPPER_COLUMN_HEIGHT)
    precinct.put("finial", 1.5, BEAM_TOP + 2 * UPPER_COLUMN_HEIGHT + 2.08, 1.5)
    precinct.bay(1, 0, 2, 0)
    precinct.bay(2, 0, 3, 0)
    precinct.bay(1, 1, 1, 2)
    precinct.bay(1, 2, 2, 2)
    precinct.bay(2, 2, 3, 2)
    precinct.bay(3, 0, 4, 0)
    precinct.bay(3, 1, 4, 1)
    precinct.bay(3, 2, 4, 2, "portal")
    for j, right in ((0, "screen"), (1, "screen")):
        precinct.bay(3, j, 3, j + 1)
        precinct.bay(4, j, 4, j + 1, right)
        precinct.cell("floor", 3, j)
        precinct.cell("roof", 3, j, BEAM_TOP, 90.0)
    precinct.gable(10.5, 0.0, 180.0)
    precinct.gable(10.5, 6.0, 0.0)
    precinct.put("statue", 10.5, 0.3, 4.5)
    precinct.put("stairs", 10.5, 0.0, 6.4)
    precinct.put("stairs", 7.5, 0.0, 6.4)
    for x in (7.5, 8.5, 9.5, 10.5):
        precinct.put("path", x, 0.0, 7.5)
    return precinct
