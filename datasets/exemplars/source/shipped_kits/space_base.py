"""The space base: six-sided hubs on a triangular lattice, joined port to port by tunnels.

The distance of hubs is 6.0. Tunnels, greenhouses, airlocks, tanks and landing pads all leave a hub through a port, so
each can be wherever another one can. Everything on a hub rests on its collar. Nothing leaves upper storeys sideways.
"""

from __future__ import annotations

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.outlines import arch, chamfered, rectangle, regular
from shipped_kits.solids import Color, Solid, bar, box, extruded, joined, loft, revolved, stacked
from stages.shape.arrays import FloatArray

HUB_SPACING = 6.0
HUB_APOTHEM = 1.3
"""Distance from the middle of a hub to a port."""
PORT_LENGTH = 0.34
TUNNEL_LENGTH = HUB_SPACING - 2 * (HUB_APOTHEM + PORT_LENGTH)
"""Distance between the ports of two neighbouring hubs."""
AXIS_Y = 1.3
"""Height of the axis of tunnels and ports above the ground."""
HUB_HEIGHT = 2.3
"""Height of a hub, on which its collar rests."""
COLLAR_HEIGHT, RISER_HEIGHT = 0.3, 1.5
PAD_DISTANCE = 2.3
"""Distance from the outer end of a port to the middle of a pad."""
JOINT_OVERLAP = 0.03
"""Depth of a part inside the part that it is joined to."""

WHITE, PALE, GREY, DARK = (236, 238, 240), (206, 212, 218), (140, 150, 162), (74, 82, 96)
ORANGE, GLASS, GLASS_DARK = (238, 136, 58), (126, 196, 218), (74, 132, 168)
LEAF, CELL = (108, 176, 96), (46, 72, 132)
GOLD, RED, LAMP = (226, 184, 92), (206, 72, 66), (252, 226, 140)


def shapes() -> dict[str, KitShape]:
    """Return the two example bases by name."""
    return {"outpost": _outpost(), "ring": _ring()}


def _types() -> dict[str, Solid]:
    return {
        "hub": _hub(),
        "port": _port(),
        "tunnel": _tunnel(),
        "greenhouse": _greenhouse(),
        "airlock": _airlock(),
        "tank": _tank(),
        "pad": _pad(),
        "rocket": _rocket(),
        "collar": _collar(),
        "riser": _riser(),
        "dome": _dome(),
        "antenna": _antenna(),
        "mast": _mast(),
        "solar_wing": _solar_wing(),
    }


def _along_x(section: FloatArray, stations: list[tuple[float, float]], colors: Color | list[Color]) -> Solid:
    """Build a lying body: the section (k, 2) in (z, y) around the origin, scaled at each station along x."""
    rings = []
    for scale, x in stations:
        rings.append(np.column_stack([np.full(len(section), x), section[:, 1] * scale, -section[:, 0] * scale]))
    return loft(rings, colors)


def _hub() -> Solid:
    outline = regular(6, HUB_APOTHEM)
    levels = [(-0.4, 0.3), (-0.08, 0.52), (-0.08, 0.6), (0.0, 0.66), (0.0, 1.94), (-0.06, 2.0), (-0.42, HUB_HEIGHT)]
    hub = stacked(outline, levels, [GREY, DARK, PALE, WHITE, ORANGE, WHITE])
    hub = hub.inset((HUB_APOTHEM, AXIS_Y, 0.0), chamfered(1.16, 1.04, 0.24), 0.06, GREY, PALE, copies=6)
    shoe = revolved([(0.2, 0.0), (0.2, 0.08), (0.1, 0.14)], 8, DARK).translated(1.38)
    leg = bar((1.02, 0.62, 0.0), (1.34, 0.1, 0.0), 0.07, GREY) + shoe
    lamp = box((0.1, 0.7, 0.24), (1.46, 0.86, 0.0), ORANGE)
    return hub + (leg + lamp).rotated(30.0).around(6)


def _port() -> Solid:
    """Build a port from a hub at x = 0 outward along x; its origin is on the ground below its axis."""
    ring = chamfered(1.1, 1.1, 0.3)
    stations = [(0.86, -0.09), (0.86, 0.06), (1.0, 0.08), (1.0, 0.26), (0.9, 0.28), (0.9, PORT_LENGTH)]
    port = _along_x(ring, stations, [DARK, GREY, ORANGE, GREY, DARK]).translated(0.0, AXIS_Y)
    light = box((0.14, 0.1, 0.2), (0.17, AXIS_Y + 0.54, 0.0), LAMP, 0.02)
    strut = box((0.12, 0.2, 0.5), (0.17, AXIS_Y - 0.73, 0.0), DARK)
    return port + light + strut


def _tunnel() -> Solid:
    half = TUNNEL_LENGTH / 2 + JOINT_OVERLAP
    ring = chamfered(0.96, 0.96, 0.3)
    ribs = [(1.0, -half), (1.0, -half + 0.14), (0.9, -half + 0.18)]
    for x in (-0.5, 0.5):
        ribs += [(0.9, x - 0.12), (1.0, x - 0.08), (1.0, x + 0.08), (0.9, x + 0.12)]
    ribs += [(0.9, half - 0.18), (1.0, half - 0.14), (1.0, half)]
    colors = [GREY, GREY, WHITE, GREY, GREY, GREY, WHITE, GREY, GREY, GREY, WHITE, GREY, GREY]
    tunnel = _along_x(ring, ribs, colors)
    for x in (-0.9, 0.0, 0.9):
        tunnel = tunnel.inset((x, 0.0, 0.432), chamfered(0.34, 0.26, 0.08), 0.05, GREY, GLASS_DARK, copies=2)
    tunnel = tunnel.translated(0.0, AXIS_Y)
    pipe = bar((-half + 0.06, AXIS_Y + 0.5, 0.14), (half - 0.06, AXIS_Y + 0.5, 0.14), 0.06, ORANGE)
    pipe = pipe + bar((half - 0.06, AXIS_Y + 0.5, -0.14), (-half + 0.06, AXIS_Y + 0.5, -0.14), 0.06, ORANGE)
    shoe = stacked(rectangle(0.5, 0.7), [(0.0, 0.0), (0.0, 0.07), (-0.06, 0.12)], DARK)
    foot = box((0.16, 0.84, 0.3), (0.0, 0.08, 0.0), GREY) + shoe
    return tunnel + pipe + foot.translated(0.5) + foot.translated(-0.5)


def _greenhouse() -> Solid:
    """Build beds under a vault of glass, as long as a tunnel."""
    half = TUNNEL_LENGTH / 2 + JOINT_OVERLAP
    end = chamfered(0.96, 0.96, 0.3)
    collar = _along_x(end, [(1.0, -half), (1.0, -half + 0.3)], GREY).translated(0.0, AXIS_Y)
    vault = arch(1.7, 1.5, 0.92, 6, y=-0.62)
    shell = _along_x(vault, [(1.0, -1.16), (1.0, 1.16)], GLASS)
    shell = shell.translated(0.0, AXIS_Y)
    for x in (-0.72, 0.0, 0.72):
        shell = shell.inset((x, AXIS_Y - 0.32, 0.85), rectangle(0.58, 0.34), 0.06, WHITE, LEAF, copies=2)
    for x in (-1.16, -0.39, 0.39, 1.16):
        shell = shell + _along_x(arch(1.8, 1.56, 0.96, 6, y=-0.64), [(1.0, -0.05), (1.0, 0.05)], WHITE).translated(
            x, AXIS_Y
        )
    plinth = stacked(rectangle(2.5, 1.86), [(-0.1, 0.16), (0.0, 0.3), (0.0, 0.78), (-0.04, 0.82)], [DARK, PALE, PALE])
    ridge = box((2.36, 0.1, 0.16), (0.0, AXIS_Y + 0.86, 0.0), WHITE)
    feet = box((0.4, 0.2, 0.4), (0.9, 0.0, 0.6), DARK)
    feet = feet + feet.translated(z=-1.2)
    return joined(collar, collar.rotated(180.0), shell, plinth, ridge, feet, feet.translated(-1.8))


def _airlock() -> Solid:
    """Build an airlock that closes a port: its inner face is the plane x = 0, it faces along x."""
    stations = [(1.0, -JOINT_OVERLAP), (1.0, 0.12), (1.16, 0.16), (1.16, 0.86), (1.0, 0.94)]
    lock = _along_x(chamfered(0.96, 0.96, 0.3), stations, [GREY, GREY, WHITE, ORANGE])
    lock = lock.inset((0.94, 0.0, 0.0), chamfered(0.68, 0.76, 0.2), 0.1, DARK, PALE)
    lock = lock.inset((0.84, 0.16, 0.0), rectangle(0.3, 0.16), 0.04, DARK, GLASS_DARK)
    lock = lock.inset((0.5, 0.0, 0.5568), chamfered(0.4, 0.3, 0.08), 0.05, GREY, GLASS_DARK)
    lock = lock.translated(0.0, AXIS_Y)
    step = box((0.62, 0.1, 0.9), (1.14, AXIS_Y - 0.56, 0.0), GREY)
    slope = np.array([(1.4, AXIS_Y - 0.58), (2.2, 0.0), (2.4, 0.0), (2.4, 0.06), (1.4, AXIS_Y - 0.42)])
    ramp = extruded(slope, -0.4, 0.4, PALE)
    stilts = bar((0.5, 0.1, 0.3), (0.5, 0.9, 0.3), 0.06, GREY) + bar((0.5, 0.1, -0.3), (0.5, 0.9, -0.3), 0.06, GREY)
    pads = box((0.3, 0.12, 0.9), (0.5, 0.0, 0.0), DARK)
    return lock + step + ramp + stilts + pads


def _tank() -> Solid:
    """Build a round tank on a port, whose outer face is the plane x = 0."""
    neck = _along_x(chamfered(0.7, 0.7, 0.22), [(1.0, -JOINT_OVERLAP), (1.0, 0.36)], GREY).translated(0.0, AXIS_Y)
    angles = np.radians([-66.0, -40.0, -12.0, 12.0, 40.0, 66.0])
    ball = [(0.92 * float(np.cos(a)), AXIS_Y + 0.92 * float(np.sin(a))) for a in angles]
    colors = [WHITE, WHITE, ORANGE, WHITE, WHITE, PALE, GREY]
    tank = revolved([*ball, (0.22, AXIS_Y + 0.86), (0.22, AXIS_Y + 1.02)], 12, colors).translated(1.12)
    legs = bar((0.72, AXIS_Y - 0.3, 0.0), (1.0, 0.08, 0.0), 0.06, GREY) + box((0.26, 0.1, 0.26), (1.0, 0.0, 0.0), DARK)
    return neck + tank + legs.rotated(45.0).around(4).translated(1.12)


def _pad() -> Solid:
    """Build a landing pad at the end of a port, whose outer face is the plane x = 0."""
    neck = _along_x(chamfered(0.7, 0.7, 0.22), [(1.0, -JOINT_OVERLAP), (1.0, 0.5)], GREY).translated(0.0, AXIS_Y)
    office = box((0.84, 1.16, 0.96), (0.64, AXIS_Y - 0.6, 0.0), WHITE, 0.1)
    office = office.inset((1.06, AXIS_Y + 0.06, 0.0), rectangle(0.66, 0.34), 0.05, GREY, GLASS_DARK)
    office = office.inset((0.7, AXIS_Y, 0.48), rectangle(0.34, 0.3), 0.05, GREY, GLASS_DARK)
    plate = stacked(regular(6, 1.5, 30.0), [(-0.5, 0.36), (0.0, 0.66), (0.0, 0.8), (-0.06, 0.86)], [DARK, GREY, PALE])
    plate = plate.inset((0.0, 0.86, 0.0), regular(6, 1.26, 30.0), -0.02, DARK, ORANGE)
    plate = plate.inset((0.0, 0.88, 0.0), regular(6, 1.12, 30.0), -0.02, DARK, DARK)
    plate = plate.inset((0.0, 0.9, 0.0), regular(8, 0.6), -0.02, DARK, WHITE)
    leg = box((0.22, 0.5, 0.22), (1.0, 0.0, 0.0), GREY)
    plate = plate + leg.around(6)
    return neck + office + plate.translated(PAD_DISTANCE)


def _rocket() -> Solid:
    """Build a rocket on a pad."""
    hull = [(0.3, 0.42), (0.44, 0.7), (0.52, 1.3), (0.52, 1.9), (0.42, 2.6), (0.26, 3.1), (0.0, 3.6)]
    rocket = revolved([(0.2, 0.26), (0.26, 0.42), *hull], 8, [DARK, DARK, GREY, WHITE, ORANGE, WHITE, WHITE, RED])
    rocket = rocket.inset((0.52, 1.6, 0.0), regular(8, 0.13), 0.05, GOLD, GLASS_DARK, copies=4)
    fin = extruded(np.array([(0.38, 0.56), (0.8, 0.0), (0.96, 0.0), (0.86, 0.5), (0.4, 1.2)]), -0.06, 0.06, RED)
    return rocket + fin.rotated(45.0).around(4)


def _collar() -> Solid:
    """Build a collar on a hub or a riser, which carries everything above."""
    profile = [(0.84, 0.0), (0.84, 0.08), (0.74, 0.12), (0.74, 0.24), (0.8, COLLAR_HEIGHT)]
    collar = revolved(profile, 12, [GREY, ORANGE, DARK, GREY])
    return collar.inset((0.0, COLLAR_HEIGHT, 0.0), regular(6, 0.46), 0.05, DARK, ORANGE)


def _riser() -> Solid:
    """Build a round room between two collars."""
    riser = revolved([(0.7, 0.0), (0.9, 0.16), (0.9, 1.3), (0.78, RISER_HEIGHT)], 12, [GREY, WHITE, PALE])
    return riser.inset((0.9, 0.76, 0.0), chamfered(0.3, 0.56, 0.1), 0.07, GREY, GLASS_DARK, copies=12)


def _dome() -> Solid:
    """Build a glass cupola on a collar."""
    angles = np.radians([0.0, 24.0, 48.0, 68.0])
    shell = [(0.94 * float(np.cos(a)), 0.2 + 0.94 * float(np.sin(a))) for a in angles]
    dome = revolved(
        [(0.96, 0.0), (1.02, 0.06), (1.02, 0.2), *shell, (0.3, 1.12), (0.2, 1.22)],
        12,
        [GREY, WHITE, WHITE, GLASS, GLASS, GLASS, WHITE, WHITE],
    )
    return dome + _dome_rib().rotated(15.0).around(6)


def _dome_rib() -> Solid:
    angles = np.radians([2.0, 24.0, 48.0, 70.0])
    section = np.array([(0.93, 0.04), (1.02, 0.04), (1.02, -0.04), (0.93, -0.04)])
    radius, across = section.T
    rings = [np.stack([radius * np.cos(a), 0.2 + radius * np.sin(a), across], axis=1) for a in angles]
    return loft(rings, WHITE)


def _antenna() -> Solid:
    """Build a dish on a collar, which faces up along x."""
    foot = revolved([(0.66, 0.0), (0.66, 0.12), (0.3, 0.2), (0.2, 0.9)], 8, [GREY, WHITE, WHITE])
    bowl = [(0.12, -0.2), (0.3, -0.16), (0.8, 0.1), (1.08, 0.42), (1.02, 0.46), (0.74, 0.18), (0.26, -0.06)]
    dish = revolved(bowl, 12, [GREY, WHITE, WHITE, ORANGE, PALE, PALE])
    feed = bar((0.0, -0.1, 0.0), (0.0, 0.66, 0.0), 0.035, GREY)
    tip = revolved([(0.0, 0.6), (0.1, 0.66), (0.1, 0.76), (0.0, 0.82)], 6, RED)
    return foot + (dish + feed + tip).rotated(-40.0, "z").translated(0.0, 1.06)


def _mast() -> Solid:
    """Build a mast, which carries solar wings along x on both sides."""
    mast = revolved([(0.6, 0.0), (0.6, 0.12), (0.24, 0.22), (0.16, 0.3), (0.16, 1.1)], 8, [GREY, WHITE, WHITE, PALE])
    head = box((0.5, 0.4, 0.5), (0.0, 1.0, 0.0), WHITE, 0.08)
    head = head.inset((0.25, 1.18, 0.0), rectangle(0.26, 0.2), 0.04, GREY, DARK, copies=2)
    lamp = revolved([(0.08, 1.36), (0.08, 1.6), (0.0, 1.7)], 6, ORANGE)
    return mast + head + lamp


def _solar_wing() -> Solid:
    """Build a panel along x; the next one docks to its outer end."""
    arm = bar((-0.06, 0.0, 0.0), (2.0, 0.0, 0.0), 0.07, GREY)
    panel = box((1.6, 0.04, 1.32), (1.0, 0.06, 0.0), PALE)
    for x in (0.48, 1.0, 1.52):
        for z in (-0.32, 0.32):
            panel = panel.inset((x, 0.1, z), rectangle(0.46, 0.56), 0.015, DARK, CELL)
    clamp = box((0.2, 0.2, 0.3), (1.94, -0.1, 0.0), ORANGE)
    return arm + panel + clamp


class _Base(KitShape):
    """Places base parts on the triangular lattice: hub (i, j) is at 6 (i + j/2) along x and 5.196 j along -z."""

    def __init__(self) -> None:
        super().__init__(_types())

    def _position(self, i: int, j: int) -> FloatArray:
        return np.array([HUB_SPACING * (i + j / 2), -HUB_SPACING * j * np.sqrt(0.75)])

    def hub(self, i: int, j: int, top: str, risers: int = 0, turn: float = 0.0) -> None:
        """Place a hub with `risers` risers, each on its collar, and the top."""
        x, z = self._position(i, j)
        self.put("hub", x, 0.0, z)
        self.put("collar", x, HUB_HEIGHT, z)
        height = HUB_HEIGHT + COLLAR_HEIGHT
        for _ in range(risers):
            self.put("riser", x, height, z)
            self.put("collar", x, height + RISER_HEIGHT, z)
            height += RISER_HEIGHT + COLLAR_HEIGHT
        wings = 0
        if top.startswith("mast"):
            wings, top = int(top[4:]), "mast"
        if top:
            self.put(top, x, height, z, turn)
        for side in (0.0, 180.0):
            along = np.radians(turn + side)
            for k in range(wings):
                out = 0.25 + 2.04 * k
                self.put("solar_wing", x + out * np.cos(along), height + 1.16, z - out * np.sin(along), turn + side)

    def _port(self, i: int, j: int, sixth: int, beyond: float = 0.0) -> tuple[float, float, float]:
        x, z = self._position(i, j)
        angle = np.radians(60.0 * sixth)
        out = HUB_APOTHEM + beyond
        return float(x + out * np.cos(angle)), float(z - out * np.sin(angle)), 60.0 * sixth

    def end(self, name: str, i: int, j: int, sixth: int) -> None:
        """Place a port on side `sixth` of a hub (counter-clockwise from +x), and what it leads to."""
        x, z, turn = self._port(i, j, sixth)
        self.put("port", x, 0.0, z, turn)
        x, z, turn = self._port(i, j, sixth, PORT_LENGTH)
        self.put(name, x, 0.0, z, turn)

    def join(self, name: str, i: int, j: int, sixth: int) -> None:
        """Place a tunnel or greenhouse from a hub to its neighbour on side `sixth`, with a port at both ends."""
        k, m = i + (1, 0, -1, -1, 0, 1)[sixth], j + (0, 1, 1, 0, -1, -1)[sixth]
        for a, b, side in ((i, j, sixth), (k, m, (sixth + 3) % 6)):
            x, z, turn = self._port(a, b, side)
            self.put("port", x, 0.0, z, turn)
        x, z = (self._position(i, j) + self._position(k, m)) / 2
        self.put(name, x, 0.0, z, 60.0 * sixth)

    def rocket(self, i: int, j: int, sixth: int) -> None:
        """Place a rocket on the pad at that side of a hub."""
        x, z, turn = self._port(i, j, sixth, PORT_LENGTH + PAD_DISTANCE)
        self.put("rocket", x, 0.9, z, turn)


def _outpost() -> KitShape:
    """Build a ring of four hubs with a cross tunnel, and arms for a pad, a tank and airlocks."""
    base = _Base()
    base.hub(0, 0, "dome")
    base.hub(1, 0, "dome", 1)
    base.hub(0, 1, "mast1", turn=60.0)
    base.hub(1, 1, "antenna", turn=120.0)
    base.hub(2, 0, "")
    base.join("tunnel", 0, 0, 0)
    base.join("tunnel", 0, 0, 1)
    base.join("greenhouse", 1, 0, 1)
    base.join("tunnel", 0, 1, 0)
    base.join("tunnel", 1, 0, 2)
    base.join("tunnel", 1, 0, 0)
    base.join("tunnel", 1, 1, 5)
    base.end("airlock", 0, 0, 4)
    base.end("pad", 2, 0, 0)
    base.rocket(2, 0, 0)
    base.end("tank", 0, 1, 2)
    base.end("airlock", 1, 1, 1)
    return base


def _ring() -> KitShape:
    """A ring of six hubs around an open court, with a tower and two branches."""
    base = _Base()
    base.hub(1, 0, "dome", 2)
    base.hub(0, 1, "mast2", turn=120.0)
    base.hub(-1, 1, "dome")
    base.hub(-1, 0, "antenna", 1, turn=240.0)
    base.hub(0, -1, "mast1", 1, turn=0.0)
    base.hub(1, -1, "dome")
    for i, j, side, name in (
        (1, 0, 2, "tunnel"), (0, 1, 3, "greenhouse"), (-1, 1, 4, "tunnel"),
        (-1, 0, 5, "tunnel"), (0, -1, 0, "tunnel"), (1, -1, 1, "greenhouse"),
    ):  # fmt: skip
        base.join(name, i, j, side)
    base.hub(2, 0, "dome")
    base.hub(2, -1, "antenna", turn=60.0)
    base.join("tunnel", 1, 0, 0)
    base.join("tunnel", 1, 0, 5)
    base.join("tunnel", 1, -1, 0)
    base.join("greenhouse", 2, -1, 1)
    base.end("airlock", 2, 0, 0)
    base.end("pad", 0, -1, 4)
    base.end("tank", -1, 0, 3)
    base.end("airlock", -1, 1, 2)
    base.end("tank", 0, 1, 1)
    return base
