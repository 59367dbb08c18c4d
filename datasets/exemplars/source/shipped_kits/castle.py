"""The castle: towers on a square lattice, joined by walls, gates and halls, with bridges out of the gates.

The distance of towers is 5.0 and their width 2.0, so what joins two of them is 3.0 long. A bridge span of 4.0 leads
from a gate to a pier or to the gate of the next ward, and so back onto the lattice.
"""

from __future__ import annotations

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.outlines import arch, chamfered, mirrored, rectangle, regular
from shipped_kits.solids import Color, Solid, bar, box, extruded, joined, revolved, stacked

TOWER_SPACING = 5.0
JOINT_OVERLAP = 0.03
"""Depth of a part inside the part that it is joined to."""

STONE, STONE_LIGHT, STONE_DARK = (196, 184, 164), (219, 209, 190), (150, 139, 124)
SLIT, PLASTER, TIMBER, WOOD = (66, 62, 70), (238, 226, 200), (112, 76, 52), (146, 103, 66)
SLATE, SLATE_DARK, TILE, TILE_DARK = (78, 112, 150), (62, 92, 128), (190, 88, 66), (160, 70, 54)
GOLD, BANNER, GLASS = (228, 178, 74), (206, 62, 62), (120, 152, 170)


def shapes() -> dict[str, KitShape]:
    """Return the two example castles by name."""
    return {"keep": _keep(), "ward": _ward()}


def _types() -> dict[str, Solid]:
    return {
        "tower_base": _tower_base(),
        "tower_shaft": _tower_shaft(),
        "tower_crown": _tower_crown(),
        "roof_cone": _roof_cone(),
        "roof_spire": _roof_spire(),
        "flag": _flag(),
        "turret": _turret(),
        "wall": _wall(),
        "wall_gate": _wall_gate(),
        "hall": _hall(),
        "cottage": _cottage(),
        "bridge_span": _bridge_span(),
        "bridge_pier": _bridge_pier(),
        "bridge_ramp": _bridge_ramp(),
    }


def _tower_base() -> Solid:
    levels = [(0.08, 0.0), (0.08, 0.36), (0.0, 0.46), (0.0, 2.26), (0.07, 2.34), (0.07, 2.46), (0.02, 2.5)]
    colors = [STONE_DARK, STONE_DARK, STONE, STONE_LIGHT, STONE_LIGHT, STONE_LIGHT]
    tower = stacked(chamfered(2.0, 2.0, 0.5), levels, colors)
    for height in (0.95, 1.65):
        at = (0.75, height, 0.75)
        tower = tower.inset(at, chamfered(0.13, 0.44, 0.05), 0.1, STONE_DARK, SLIT, copies=4)
    return tower


def _tower_shaft() -> Solid:
    levels = [(0.05, 0.0), (0.05, 0.12), (0.0, 0.18), (0.0, 1.5)]
    shaft = stacked(chamfered(1.84, 1.84, 0.46), levels, [STONE_LIGHT, STONE_LIGHT, STONE])
    frame = arch(0.46, 0.78, 0.3, y=-0.36)
    shaft = shaft.inset((0.92, 0.82, 0.0), frame, -0.05, STONE_LIGHT, copies=4)
    return shaft.inset((0.97, 0.82, 0.0), arch(0.28, 0.6, 0.22, y=-0.28), 0.16, STONE_DARK, SLIT, copies=4)


def _tower_crown() -> Solid:
    outline = chamfered(1.84, 1.84, 0.46)
    levels = [(0.0, 0.0), (0.0, 0.06), (0.2, 0.36), (0.2, 0.44), (0.24, 0.48), (0.24, 0.84)]
    crown = stacked(outline, levels, [STONE, STONE_DARK, STONE, STONE_LIGHT, STONE])
    crown = crown.inset((0.0, 0.84, 0.0), chamfered(1.86, 1.86, 0.52), 0.34, STONE_DARK, WOOD)
    crown = crown.inset((1.045, 0.84, 0.0), rectangle(0.18, 0.62), -0.3, STONE, STONE_LIGHT, shrink=0.015, copies=4)
    turned = rectangle(0.16, 0.44) @ np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    return crown.inset((0.793, 0.84, -0.793), turned, -0.3, STONE, STONE_LIGHT, shrink=0.015, copies=4)


def _roof_cone() -> Solid:
    """Build a roof on the floor of the crown, half a unit above the crown's foot."""
    outline = chamfered(1.4, 1.4, 0.38)
    drum = [(0.0, 0.0), (0.0, 0.86)]
    eaves = [(0.5, 0.78), (0.52, 0.86), (0.2, 1.34), (0.22, 1.4), (-0.1, 1.94), (-0.08, 2.0)]
    colors = [PLASTER, TIMBER, TILE_DARK, *[TILE, TILE_DARK] * 3]
    roof = stacked(outline, [*drum, *eaves, (-0.4, 2.66), (-0.6, 2.9)], colors)
    return roof.inset((0.7, 0.46, 0.0), arch(0.3, 0.44, 0.15, 4, y=-0.2), 0.1, TIMBER, SLIT, copies=4)


def _roof_spire() -> Solid:
    drum = [(0.72, 0.0), (0.72, 1.0), (0.98, 0.94), (1.0, 1.02)]
    steps = [(0.74, 1.62), (0.76, 1.67), (0.5, 2.36), (0.52, 2.41), (0.25, 3.2), (0.27, 3.25), (0.1, 3.9)]
    colors = [STONE_LIGHT, TIMBER, SLATE_DARK, *[SLATE, SLATE_DARK] * 3, SLATE]
    spire = revolved([*drum, *steps], 8, colors)
    window = arch(0.22, 0.56, 0.14, 4, y=-0.26)
    spire = spire.inset((0.72, 0.5, 0.0), window, 0.1, STONE_DARK, SLIT, copies=8)
    # Four dormers keep the spire from turning by an eighth.
    dormer = box((0.3, 0.26, 0.3), (0.78, 1.2, 0.0), PLASTER) + _gable(0.4, 0.2, 0.4, SLATE_DARK).translated(
        0.8, 1.46, 0.0
    )
    return spire + dormer.around(4)


def _gable(width: float, height: float, length: float, color: Color) -> Solid:
    """Build a small roof with its ridge along x."""
    outline = np.array([[-width / 2, 0.0], [width / 2, 0.0], [0.0, height]])
    return extruded(outline, -length / 2, length / 2, color).rotated(90.0)


def _flag() -> Solid:
    """Build a gilt ball, a pole and a swallow-tailed banner; its foot goes over the tip of a roof."""
    ball = revolved([(0.0, -0.06), (0.13, 0.0), (0.17, 0.14), (0.13, 0.28), (0.05, 0.33)], 8, GOLD)
    pole = revolved([(0.035, 0.3), (0.035, 1.46), (0.0, 1.56)], 6, TIMBER)
    cloth = np.array([[0.0, 0.82], [0.86, 0.86], [0.62, 1.1], [0.86, 1.34], [0.0, 1.38]])
    stripe = np.array([[0.16, 0.99], [0.56, 1.0], [0.48, 1.1], [0.56, 1.2], [0.16, 1.21]])
    return ball + pole + extruded(cloth, -0.022, 0.022, BANNER) + extruded(stripe, -0.036, 0.036, GOLD)


def _turret() -> Solid:
    """Build a bartizan on a slanted corner of a shaft; its axis is 1.27 from the shaft's, outward along x."""
    foot = [(0.0, 0.12), (0.2, 0.24), (0.26, 0.34), (0.34, 0.44)]
    colors = [STONE_DARK, STONE_DARK, STONE_LIGHT, PLASTER, TIMBER, SLATE_DARK, SLATE]
    turret = revolved([*foot, (0.34, 0.84), (0.44, 0.82), (0.45, 0.88), (0.0, 1.4)], 8, colors)
    turret = turret.inset((0.34, 0.64, 0.0), rectangle(0.12, 0.2), 0.06, TIMBER, SLIT)
    return turret.translated(1.27)


def _wall() -> Solid:
    half = TOWER_SPACING / 2 - 1.0 + JOINT_OVERLAP
    plinth, parapet = ((0.43, 0.0), (0.43, 0.3), (0.35, 0.38)), ((0.43, 1.7), (0.43, 2.06), (0.25, 2.06), (0.25, 1.82))
    wall = extruded(mirrored(*plinth, (0.35, 1.6), *parapet), -half, half, STONE).rotated(90.0)
    wall = wall.tinted(STONE_DARK, lambda _, corners: bool(corners[:, 1].max() < 0.39))
    for x in (-1.1, -0.66, -0.22, 0.22, 0.66, 1.1):
        wall = wall.inset((x, 2.06, 0.34), rectangle(0.26, 0.14), -0.26, STONE, STONE_LIGHT, shrink=0.015, copies=2)
    for x in (-1.0, 0.0, 1.0):
        wall = wall.inset((x, 1.06, 0.35), chamfered(0.12, 0.5, 0.05), 0.09, STONE_DARK, SLIT, copies=2)
    for x in (-0.5, 0.5):
        wall = wall.inset((x, 0.98, 0.35), rectangle(0.16, 1.16), -0.06, STONE_LIGHT, shrink=0.02, copies=2)
    return wall


def _wall_gate() -> Solid:
    half = TOWER_SPACING / 2 - 1.0 + JOINT_OVERLAP
    head = arch(1.0, 1.5, 0.55, 8)[2:]
    outline = mirrored((0.5, 0.0), (half, 0.0), (half, 2.06), (1.04, 2.06), (0.94, 2.18), (0.94, 2.78))
    gate = extruded(np.concatenate([outline, head[::-1]]), -0.5, 0.5, STONE)
    for x in (-0.72, -0.24, 0.24, 0.72):
        gate = gate.inset((x, 2.78, 0.4), rectangle(0.28, 0.15), -0.26, STONE, STONE_LIGHT, shrink=0.015, copies=2)
    for x in (-1.28, 1.28):
        gate = gate.inset((x, 2.06, 0.4), rectangle(0.24, 0.15), -0.26, STONE, STONE_LIGHT, shrink=0.015, copies=2)
        gate = gate.inset((x, 1.2, 0.5), chamfered(0.12, 0.5, 0.05), 0.09, STONE_DARK, SLIT, copies=2)
    shield = np.array([(0.0, -0.26), (0.2, -0.06), (0.2, 0.2), (-0.2, 0.2), (-0.2, -0.06)])
    gate = gate.inset((0.0, 2.16, 0.5), shield, -0.05, GOLD, BANNER, shrink=0.03, copies=2)
    for x in (-0.8, 0.8):
        gate = gate.inset((x, 1.2, 0.5), rectangle(0.24, 1.9), -0.07, STONE_LIGHT, shrink=0.02, copies=2)
    sill = box((1.06, 0.36, 0.996), (0.0, 0.02, 0.0), STONE_DARK)
    posts = [bar((x, 0.3, 0.0), (x, 1.62, 0.0), 0.035, TIMBER, 4) for x in (-0.3, -0.1, 0.1, 0.3)]
    rails = [bar((-0.56, y, 0.0), (0.56, y, 0.0), 0.03, TIMBER, 4) for y in (0.72, 1.0, 1.28)]
    return joined(gate, sill, *posts, *rails)


def _hall() -> Solid:
    half = TOWER_SPACING / 2 - 1.0 + JOINT_OVERLAP
    hall = box((2 * half, 0.5, 1.16), (0.0, 0.0, 0.0), STONE)
    upper = box((2 * half - 0.02, 1.04, 1.3), (0.0, 0.48, 0.0), PLASTER)
    for x in (-0.99, -0.33, 0.33, 0.99):
        upper = upper.inset((x, 1.02, 0.65), arch(0.34, 0.62, 0.14, 4, y=-0.3), -0.04, TIMBER, copies=2)
        upper = upper.inset((x, 1.02, 0.69), arch(0.22, 0.48, 0.09, 4, y=-0.23), 0.08, TIMBER, GLASS, copies=2)
    for x in (-1.34, -0.66, 0.0, 0.66, 1.34):
        upper = upper.inset((x, 1.0, 0.65), rectangle(0.1, 0.92), -0.03, TIMBER, copies=2)
    roof = mirrored((0.82, 1.42), (0.82, 1.5), (0.42, 1.96), (0.44, 2.02), (0.06, 2.42))
    tiles = extruded(roof, -half + 0.005, half - 0.005, TILE).rotated(90.0)
    chimney = [box((0.2, 0.7, 0.2), (x, 1.94, z), STONE_LIGHT, 0.03) for x, z in ((0.8, 0.36), (-0.8, -0.36))]
    return joined(hall, upper, tiles, *chimney)


def _cottage() -> Solid:
    """Build a cottage that leans on a wall: the wall's axis is the line z = 0, the cottage is at positive z."""
    body = box((1.1, 0.86, 0.78), (0.0, 0.0, 0.79), PLASTER)
    body = body.inset((0.0, 0.36, 1.18), rectangle(0.26, 0.6), -0.03, TIMBER, WOOD, shrink=0.03)
    for x in (-0.36, 0.36):
        body = body.inset((x, 0.5, 1.18), rectangle(0.24, 0.28), -0.03, TIMBER)
        body = body.inset((x, 0.5, 1.21), rectangle(0.16, 0.2), 0.05, TIMBER, GLASS)
    for side in (-1.0, 1.0):
        body = body.inset((side * 0.55, 0.5, 0.8), rectangle(0.22, 0.28), 0.05, TIMBER, GLASS)
    ridge = mirrored((0.65, 0.76), (0.65, 0.84), (0.3, 1.16), (0.31, 1.21), (0.04, 1.44))
    roof = extruded(ridge, 0.38, 1.26, TILE)
    chimney = box((0.16, 0.5, 0.16), (0.36, 1.02, 0.62), STONE_LIGHT, 0.02)
    return body + roof + chimney


def _bridge_span() -> Solid:
    """Build a span along z; the faces of gates or piers are at a distance of 4.0."""
    half = 2.0 + JOINT_OVERLAP
    under = arch(2.8, 0.46, 0.4, 8, y=-0.12)[2:]
    outline = np.concatenate([mirrored((1.4, -0.1), (half, -0.1), (half, 0.38)), under[-2:0:-1]])
    span = extruded(outline, -0.42, 0.42, STONE).rotated(90.0)
    rail = box((0.12, 0.26, 2 * half - 0.02), (0.0, 0.36, 0.0), STONE_LIGHT, 0.03)
    span = span + rail.translated(-0.36) + rail.translated(0.36)
    for z in (-1.2, 0.0, 1.2):
        post = box((0.2, 0.36, 0.2), (0.0, 0.34, z), STONE, 0.05)
        span = span + post.translated(-0.36) + post.translated(0.36)
    return span


def _bridge_pier() -> Solid:
    levels = [(0.16, -0.1), (0.16, 0.06), (0.0, 0.16), (0.0, 0.42)]
    pier = stacked(chamfered(1.0, 1.0, 0.16), levels, [STONE_DARK, STONE_DARK, STONE])
    pier = pier.inset((0.0, 0.42, 0.0), regular(8, 0.22), 0.03, STONE_DARK, STONE_LIGHT)
    lamp = revolved([(0.0, 0.84), (0.08, 0.9), (0.09, 0.98), (0.0, 1.1)], 6, GOLD).translated(0.36, 0.0, 0.36)
    post = box((0.15, 0.46, 0.15), (0.36, 0.4, 0.36), STONE_LIGHT, 0.02)
    return pier + (post + lamp).around(4)


def _bridge_ramp() -> Solid:
    """Build a ramp from a gate or a pier, whose face is the plane z = 0, towards positive z."""
    outline = np.array([(JOINT_OVERLAP, -0.1), (JOINT_OVERLAP, 0.38), (-0.3, 0.38), (-1.6, -0.04), (-1.6, -0.1)])
    ramp = extruded(outline, -0.42, 0.42, STONE).rotated(90.0)
    for t in (0.2, 0.4, 0.6, 0.8):
        tread = box((0.7, 0.05, 0.1), (0.0, 0.35 - 0.42 * t, 0.3 + 1.3 * t), STONE_LIGHT)
        ramp = ramp + tread
    post = stacked(rectangle(0.2, 0.2), [(0.0, -0.1), (0.0, 0.42), (-0.05, 0.5)], STONE_LIGHT).translated(
        0.36, 0.0, 1.46
    )
    return ramp + post + post.translated(-0.72)


class _Castle(KitShape):
    """Places castle parts by lattice coordinates: (i, j) is at x = 5 i, z = 5 j."""

    def __init__(self) -> None:
        super().__init__(_types())

    def tower(self, i: float, j: float, shafts: int, top: str = "", turrets: tuple[int, ...] = ()) -> None:
        """Place a tower; `top` is a roof, `+flag` adds a flag; turrets are corners of the top shaft."""
        x, z = TOWER_SPACING * i, TOWER_SPACING * j
        self.put("tower_base", x, 0.0, z)
        for level in range(shafts):
            self.put("tower_shaft", x, 2.5 + 1.5 * level, z)
        for corner in turrets:
            self.put("turret", x, 2.5 + 1.5 * (shafts - 1), z, 45.0 + 90.0 * corner)
        height = 2.5 + 1.5 * shafts
        self.put("tower_crown", x, height, z)
        roof, _, flag = top.partition("+")
        if roof:
            self.put(f"roof_{roof}", x, height + 0.5, z)
        if flag:
            self.put("flag", x, height + 0.5 + {"cone": 2.9, "spire": 3.9}[roof], z)

    def join(self, name: str, i: float, j: float, k: float, m: float) -> None:
        """Place a wall, gate or hall between two neighbouring towers."""
        self.put(name, TOWER_SPACING * (i + k) / 2, 0.0, TOWER_SPACING * (j + m) / 2, 0.0 if j == m else 90.0)


def _ward() -> KitShape:
    """Build two wards on both sides of a river, a bridge between their gates, and a wall to a watchtower."""
    castle = _Castle()
    castle.tower(0, 0, 1, "cone")
    castle.tower(1, 0, 2, "spire+flag", (0, 2))
    castle.tower(2, 0, 1)
    castle.tower(0, 1, 1)
    castle.tower(1, 1, 1, "cone+flag")
    castle.tower(2, 1, 1, "cone")
    castle.join("wall", 0, 0, 1, 0)
    castle.join("hall", 1, 0, 2, 0)
    castle.join("wall", 0, 0, 0, 1)
    castle.join("wall", 2, 0, 2, 1)
    castle.join("wall_gate", 0, 1, 1, 1)
    castle.join("wall", 1, 1, 2, 1)
    castle.join("wall", 1, 0, 1, 1)
    castle.put("cottage", 7.5, 0.0, 5.0, 180.0)
    castle.put("cottage", 5.0, 0.0, 2.5, 270.0)
    castle.put("bridge_span", 2.5, 0.0, 7.5)
    castle.tower(0, 2, 1, "cone")
    castle.tower(1, 2, 1)
    castle.tower(0, 3, 2)
    castle.tower(1, 3, 1, "cone")
    castle.join("wall_gate", 0, 2, 1, 2)
    castle.join("wall", 0, 2, 0, 3)
    castle.join("hall", 1, 2, 1, 3)
    castle.join("wall", 0, 3, 1, 3)
    castle.join("wall", 1, 3, 2, 3)
    castle.tower(2, 3, 1, "", (1,))
    castle.put("cottage", 0.0, 0.0, 12.5, 90.0)
    return castle


def _keep() -> KitShape:
    """Build three wards around a high keep, a gate with a ramp, and a bridge on a pier to a gatehouse."""
    castle = _Castle()
    castle.tower(1, 1, 3, "spire+flag")
    castle.tower(0, 0, 2, "cone", (2,))
    castle.tower(1, 0, 1)
    castle.tower(2, 0, 1, "spire")
    castle.tower(0, 1, 1)
    castle.tower(2, 1, 1, "", (0,))
    castle.tower(0, 2, 1, "cone")
    castle.tower(1, 2, 1, "cone+flag", (3,))
    castle.join("wall", 0, 0, 1, 0)
    castle.join("hall", 1, 0, 2, 0)
    castle.join("wall", 0, 0, 0, 1)
    castle.join("wall", 2, 0, 2, 1)
    castle.join("wall", 1, 1, 2, 1)
    castle.join("wall", 1, 0, 1, 1)
    castle.join("wall", 0, 1, 1, 1)
    castle.join("hall", 0, 1, 0, 2)
    castle.join("wall", 1, 1, 1, 2)
    castle.join("wall_gate", 0, 2, 1, 2)
    castle.put("cottage", 5.0, 0.0, 2.5, 90.0)
    castle.put("cottage", 2.5, 0.0, 5.0, 0.0)
    castle.put("bridge_span", 2.5, 0.0, 12.5)
    castle.put("bridge_pier", 2.5, 0.0, 15.0)
    castle.put("bridge_ramp", 3.0, 0.0, 15.0, 90.0)
    castle.put("bridge_span", 2.5, 0.0, 17.5)
    castle.join("wall_gate", 0, 4, 1, 4)
    castle.tower(0, 4, 1)
    castle.tower(1, 4, 1, "cone")
    castle.join("wall", 2, 1, 3, 1)
    castle.tower(3, 1, 2, "cone+flag")
    castle.join("wall_gate", 3, 1, 3, 2)
    castle.put("bridge_ramp", 15.5, 0.0, 7.5, 90.0)
    castle.tower(3, 2, 1)
    return castle
