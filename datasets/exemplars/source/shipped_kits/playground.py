"""The playground: eight-sided decks on posts, joined gate to gate by bridges, and sandboxes on the ground between them.

Decks and sandboxes stand on one lattice with a pitch of 4.0 in eight directions: square loops, octagons and all that
lies between. A deck is left through a gate, so bridges, slides, ladders and poles are exchangeable; slides lead down
to a sandbox exactly one pitch away, and balance beams join sandboxes. Towers grow only upward, on rings.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.outlines import arch, mirrored, rectangle, regular
from shipped_kits.solids import Color, Solid, bar, box, extruded, joined, revolved, stacked, swept

DECK_SPACING = 4.0
DECK_APOTHEM = 1.0
"""Of a deck, from its middle to a gate."""
GATE_DEPTH = 0.16
"""Thickness of a gate."""
BRIDGE_LENGTH = DECK_SPACING - 2 * (DECK_APOTHEM + GATE_DEPTH)
"""Distance between the gates of two neighbouring decks."""
FLOOR_Y = 1.3
"""Height of a deck above the ground."""
POST_HEIGHT, RING_HEIGHT, STOREY_HEIGHT = 2.5, 0.16, 1.5
SANDBOX_APOTHEM = 0.9
JOINT_OVERLAP = 0.03
"""Depth of a part inside the part that it is joined to."""

WOOD, WOOD_DARK, WOOD_LIGHT = (206, 160, 106), (164, 118, 76), (228, 190, 138)
RED, RED_DARK, YELLOW, YELLOW_DARK = (222, 82, 74), (188, 62, 58), (248, 200, 84), (222, 168, 56)
BLUE, BLUE_DARK, GREEN, GREEN_DARK = (78, 150, 212), (56, 118, 178), (112, 184, 104), (82, 150, 82)
STEEL, ROPE, SANDY, WHITE = (176, 188, 198), (232, 214, 178), (240, 220, 166), (244, 242, 236)

Position = tuple[float, float]


def shapes() -> dict[str, KitShape]:
    """Return the two example playgrounds by name."""
    return {"fort": _fort(), "loop": _loop()}


def _types() -> dict[str, Solid]:
    return {
        "deck": _deck(),
        "gate": _gate(),
        "ring": _ring(),
        "storey": _storey(),
        "roof_tent": _roof_tent(),
        "roof_cap": _roof_cap(),
        "pennant": _pennant(),
        "bridge_planks": _bridge_planks(),
        "bridge_tube": _bridge_tube(),
        "bridge_bars": _bridge_bars(),
        "slide": _slide(),
        "ladder": _steps_down(),
        "pole": _pole(),
        "climbing_wall": _climbing_wall(),
        "sandbox": _sandbox(),
        "balance_beam": _balance_beam(),
        "parasol": _parasol(),
    }


def _posts(low: float, high: float, color: Color) -> Solid:
    """Build eight posts at the corners of a deck."""
    reach = DECK_APOTHEM / np.cos(np.pi / 8) - 0.03
    return revolved([(0.06, low), (0.06, high)], 6, color).translated(reach).rotated(22.5).around(8)


def _deck() -> Solid:
    planks = stacked(
        regular(8, DECK_APOTHEM),
        [(-0.04, FLOOR_Y - 0.16), (0.0, FLOOR_Y - 0.12), (0.0, FLOOR_Y)],
        [WOOD_DARK, WOOD],
    )
    planks = planks.inset((0.0, FLOOR_Y, 0.0), regular(8, 0.8), -0.02, WOOD_LIGHT, WOOD_LIGHT)
    planks = planks.inset((0.0, FLOOR_Y + 0.02, 0.0), regular(8, 0.34), -0.015, YELLOW_DARK, YELLOW)
    feet = revolved([(0.13, 0.0), (0.13, 0.06), (0.08, 0.12)], 6, STEEL).translated(
        DECK_APOTHEM / np.cos(np.pi / 8) - 0.03
    )
    return planks + _posts(0.05, POST_HEIGHT, WOOD_DARK) + feet.rotated(22.5).around(8)


def _gate() -> Solid:
    """Build a gate at the edge of a deck at x = 0 that opens along x; its foot is on the ground below."""
    half = 0.34
    opening = arch(0.52, 0.94, 0.26, 6, y=FLOOR_Y + 0.02)[2:]
    low, high = FLOOR_Y - 0.14, FLOOR_Y + 0.98
    outline = mirrored((0.26, low), (half, low), (half, high), (0.2, high + 0.14))
    frame = extruded(np.concatenate([outline, opening[::-1]]), -JOINT_OVERLAP, GATE_DEPTH, GREEN).rotated(90.0)
    sill = box(
        (GATE_DEPTH + JOINT_OVERLAP - 0.01, 0.15, 0.56),
        ((GATE_DEPTH - JOINT_OVERLAP) / 2, FLOOR_Y - 0.145, 0.0),
        WOOD_LIGHT,
    )
    star = (
        revolved([(0.06, 0.0), (0.05, 0.03)], 6, YELLOW)
        .rotated(-90.0, "z")
        .translated(GATE_DEPTH - 0.01, FLOOR_Y + 1.03)
    )
    return frame + sill + star


def _ring() -> Solid:
    """Build a hoop on the posts of a deck or a storey, which carries everything above."""
    levels = [(0.06, 0.0), (0.08, 0.04), (0.08, RING_HEIGHT - 0.04), (0.05, RING_HEIGHT)]
    hoop = stacked(regular(8, DECK_APOTHEM), levels, [BLUE_DARK, BLUE, BLUE])
    return hoop.inset((0.0, RING_HEIGHT, 0.0), regular(8, 0.86), RING_HEIGHT - 0.02, BLUE_DARK, WOOD_LIGHT)


def _storey() -> Solid:
    """Build an upper deck with a parapet on a ring; its posts carry the next ring."""
    floor = stacked(regular(8, DECK_APOTHEM), [(0.0, 0.0), (0.04, 0.05), (0.04, 0.12)], [WOOD_DARK, WOOD])
    floor = floor.inset((0.0, 0.12, 0.0), regular(8, 0.9), -0.5, WOOD, WOOD_LIGHT)
    floor = floor.inset((0.0, 0.62, 0.0), regular(8, 0.8), 0.44, WOOD_DARK, WOOD_LIGHT)
    for color in (RED, YELLOW):
        floor = floor.inset((0.9, 0.37, 0.0), regular(8, 0.13), 0.06, WOOD_DARK, color, copies=4).rotated(45.0)
    return floor + _posts(0.02, STOREY_HEIGHT, WOOD_DARK)


def _roof_tent() -> Solid:
    """Build a striped tent roof on a ring."""
    roof = revolved([(1.2, 0.0), (1.22, 0.1), (0.62, 0.66), (0.1, 1.34)], 8, RED)
    roof = roof.tinted(WHITE, lambda index, _: index < 24 and index % 2 == 1)
    return roof + revolved([(0.13, 1.3), (0.16, 1.38), (0.08, 1.48)], 8, YELLOW)


def _roof_cap() -> Solid:
    """Build a rounded roof on a ring."""
    angles = np.radians([4.0, 28.0, 52.0, 74.0])
    dome = [(1.08 * float(np.cos(a)), 0.06 + 0.98 * float(np.sin(a))) for a in angles]
    brim = [(0.98, 0.0), (1.2, 0.0), (1.22, 0.08)]
    cap = revolved([*brim, *dome, (0.12, 1.06)], 16, [GREEN_DARK] * 3 + [GREEN] * 4)
    return cap + revolved([(0.1, 1.02), (0.16, 1.12), (0.12, 1.24), (0.08, 1.26)], 8, YELLOW)


def _pennant() -> Solid:
    """Build a pole with a pennant on the knob of a roof."""
    profile = [(0.035, -0.03), (0.035, 0.86), (0.06, 0.88), (0.06, 0.96), (0.0, 1.0)]
    pole = revolved(profile, 6, [STEEL, STEEL, YELLOW, YELLOW])
    cloth = extruded(np.array([(0.0, 0.44), (0.6, 0.62), (0.0, 0.8)]), -0.02, 0.02, BLUE)
    return pole + cloth


def _bridge_planks() -> Solid:
    """Build a hanging bridge of planks along x."""
    half = BRIDGE_LENGTH / 2 + JOINT_OVERLAP
    xs = np.linspace(-half, half, 9)
    sag = [float(0.14 * (x / half) ** 2 - 0.14) for x in xs]
    path = [(float(x), FLOOR_Y - 0.1 + s) for x, s in zip(xs, sag, strict=True)]
    pieces = [
        box((0.15, 0.05, 0.56), ((x0 + x1) / 2, (y0 + y1) / 2 + 0.03, 0.0), WOOD_LIGHT, 0.01)
        for (x0, y0), (x1, y1) in pairwise(path)
    ]
    for side in (-1.0, 1.0):
        pieces += [
            swept([(x, y, 0.2 * side) for x, y in path], rectangle(0.06, 0.06), ROPE),
            swept([(x, y + 0.62, 0.29 * side) for x, y in path], regular(4, 0.03), ROPE),
            *(bar((x, y + 0.02, 0.26 * side), (x, y + 0.62, 0.29 * side), 0.02, ROPE, 4) for x, y in path[1:-1:2]),
        ]
    return joined(*pieces)


def _bridge_tube() -> Solid:
    """Build a crawling tube along x."""
    half = BRIDGE_LENGTH / 2 + JOINT_OVERLAP
    rims = [(0.35, 0.04), (0.31, 0.06), (0.31, half - 0.12), (0.36, half - 0.1), (0.36, half)]
    left = [(apothem, -x) for apothem, x in rims[::-1]]
    ribs = [YELLOW_DARK, YELLOW_DARK, YELLOW, YELLOW_DARK]
    tube = revolved([*left, *rims], 8, [*ribs, YELLOW_DARK, *ribs[::-1]]).rotated(-90.0, "z")
    for x in (-0.46, 0.46):
        tube = tube.inset((x, 0.0, 0.31), regular(8, 0.1), 0.06, BLUE_DARK, BLUE, copies=2)
    handle = box((0.4, 0.08, 0.08), (0.46, 0.29, 0.0), RED, 0.02)
    return (tube + handle + handle.translated(-0.92)).translated(0.0, FLOOR_Y + 0.36)


def _bridge_bars() -> Solid:
    """Build monkey bars along x over a walk of two beams."""
    half = BRIDGE_LENGTH / 2 + JOINT_OVERLAP
    pieces = []
    for z in (-0.24, 0.24):
        pieces.append(box((2 * half, 0.08, 0.1), (0.0, FLOOR_Y - 0.12, z), RED, 0.02))
        pieces.append(bar((-half, FLOOR_Y + 0.9, z), (half, FLOOR_Y + 0.9, z), 0.045, BLUE))
        pieces += [bar((x, FLOOR_Y - 0.06, z), (x, FLOOR_Y + 0.9, z), 0.03, BLUE) for x in (-0.44, 0.44)]
    crossbars = np.linspace(-0.66, 0.66, 5).tolist()
    boards = np.linspace(-0.7, 0.7, 6).tolist()
    return joined(
        *pieces,
        *(bar((x, FLOOR_Y + 0.9, -0.24), (x, FLOOR_Y + 0.9, 0.24), 0.028, STEEL) for x in crossbars),
        *(box((0.14, 0.05, 0.56), (x, FLOOR_Y - 0.06, 0.0), WOOD_LIGHT, 0.01) for x in boards),
    )


def _slide() -> Solid:
    """Build a slide along x from a gate at x = 0 to a sandbox at DECK_SPACING from the middle of the deck."""
    end = DECK_SPACING - DECK_APOTHEM - GATE_DEPTH - SANDBOX_APOTHEM + 0.06
    path = [
        (-JOINT_OVERLAP, FLOOR_Y),
        (0.26, FLOOR_Y - 0.02),
        (0.6, FLOOR_Y - 0.26),
        (1.3, FLOOR_Y - 0.86),
        (1.62, 0.3),
        (end, 0.22),
    ]
    trough = mirrored((0.3, -0.06), (0.3, 0.16), (0.23, 0.16), (0.19, 0.0))
    slide = swept([(x, y, 0.0) for x, y in path], trough, YELLOW)
    leg = bar((1.0, 0.04, 0.2), (1.0, FLOOR_Y - 0.64, 0.2), 0.045, STEEL)
    bow = mirrored((0.27, 0.1), (0.27, 0.56), (0.1, 0.72))
    hoop = swept([(0.12, FLOOR_Y + y, -z) for z, y in bow.tolist()], regular(6, 0.035), RED)
    return slide + leg + leg.translated(z=-0.4) + hoop


def _steps_down() -> Solid:
    """Build a ladder down from a gate at x = 0."""
    stile = [(0.04, FLOOR_Y + 0.52), (0.12, FLOOR_Y + 0.56), (0.26, FLOOR_Y + 0.42), (0.72, 0.0)]
    stiles = [swept([(x, y, z) for x, y in stile], regular(6, 0.045), BLUE) for z in (-0.26, 0.26)]
    heights = [0.22 + 0.26 * k for k in range(5)]
    crossbars = [
        box((0.14, 0.06, 0.52), (0.72 - 0.46 * y / (FLOOR_Y + 0.42), y, 0.0), WOOD_LIGHT, 0.015) for y in heights
    ]
    return joined(*stiles, *crossbars, box((0.3, 0.08, 0.5), (0.12, FLOOR_Y - 0.1, 0.0), WOOD))


def _pole() -> Solid:
    """Build a fireman's pole in front of a gate at x = 0."""
    pole = bar((0.46, 0.02, 0.0), (0.46, FLOOR_Y + 0.98, 0.0), 0.05, STEEL, 8)
    bow = mirrored((0.28, -JOINT_OVERLAP), (0.28, 0.3), (0.16, 0.46))
    arm = swept([(x, FLOOR_Y + 0.98, z) for z, x in bow.tolist()], regular(6, 0.045), RED)
    foot = revolved([(0.3, 0.0), (0.3, 0.05), (0.1, 0.1)], 8, RED_DARK).translated(0.46)
    return pole + arm + foot


def _climbing_wall() -> Solid:
    """Build a leaning wall with holds, up to a gate at x = 0."""
    profile = np.array(
        [
            (-JOINT_OVERLAP, FLOOR_Y - 0.02),
            (-JOINT_OVERLAP, FLOOR_Y - 0.14),
            (0.6, 0.0),
            (0.76, 0.0),
            (0.12, FLOOR_Y - 0.02),
        ]
    )
    wall = extruded(profile, -0.31, 0.31, GREEN)
    for k, (t, z) in enumerate(((0.2, -0.14), (0.36, 0.12), (0.52, -0.1), (0.68, 0.14), (0.84, -0.12))):
        at = (0.76 - 0.64 * t, (FLOOR_Y - 0.02) * t, z)
        wall = wall.inset(at, regular(6, 0.07), -0.05, (RED, YELLOW, BLUE)[k % 3], shrink=0.025)
    return wall


def _sandbox() -> Solid:
    frame = stacked(regular(8, SANDBOX_APOTHEM), [(0.0, 0.0), (0.0, 0.2), (-0.03, 0.24)], WOOD)
    frame = frame.inset((0.0, 0.24, 0.0), regular(8, 0.72), 0.12, WOOD_DARK, SANDY)
    mound = revolved([(0.36, 0.1), (0.3, 0.19), (0.22, 0.23)], 8, SANDY)
    return frame + mound


def _balance_beam() -> Solid:
    """Build a log on stumps along x, between two sandboxes."""
    half = DECK_SPACING / 2 - SANDBOX_APOTHEM + JOINT_OVERLAP
    log = bar((-half, 0.14, 0.0), (half, 0.14, 0.0), 0.09, WOOD_DARK, 8)
    for x in (-0.7, 0.0, 0.7):
        log = log + revolved([(0.22, 0.0), (0.22, 0.26), (0.18, 0.3)], 8, [WOOD_DARK, WOOD_LIGHT]).translated(x)
    return log


def _parasol() -> Solid:
    """Build a parasol in the middle of a sandbox."""
    pole = revolved([(0.17, -0.03), (0.17, 0.03), (0.05, 0.07), (0.05, 1.5)], 8, [BLUE_DARK, BLUE_DARK, WHITE])
    profile = [(0.06, 1.36), (0.82, 1.2), (0.84, 1.26), (0.44, 1.52), (0.06, 1.66)]
    shade = revolved(profile, 8, [BLUE_DARK, BLUE, BLUE, BLUE])
    shade = shade.tinted(WHITE, lambda index, _: 8 <= index < 32 and index % 2 == 1)
    tip = revolved([(0.05, 1.62), (0.08, 1.7), (0.0, 1.82)], 8, YELLOW)
    return pole + shade + tip


class _Playground(KitShape):
    """Places playground parts; positions are points (x, z), directions count eighths of a turn from +x, towards -z."""

    def __init__(self) -> None:
        super().__init__(_types())

    def deck(self, position: Position, top: str = "", storeys: int = 0) -> None:
        """Place a deck, `storeys` storeys on it, and a roof; `+pennant` after its name adds a pennant."""
        x, z = position
        self.put("deck", x, 0.0, z)
        self.put("ring", x, POST_HEIGHT, z)
        height = POST_HEIGHT + RING_HEIGHT
        for _ in range(storeys):
            self.put("storey", x, height, z)
            self.put("ring", x, height + STOREY_HEIGHT, z)
            height += STOREY_HEIGHT + RING_HEIGHT
        roof, _, pennant = top.partition("+")
        if roof:
            self.put(f"roof_{roof}", x, height, z)
        if pennant:
            self.put("pennant", x, height + {"tent": 1.48, "cap": 1.26}[roof], z)

    def end(self, name: str, position: Position, eighth: int) -> None:
        """Place a gate of a deck, and a slide, ladder, pole or climbing wall down from it."""
        self.put("gate", *_from(position, eighth, DECK_APOTHEM), 45.0 * eighth)
        self.put(name, *_from(position, eighth, DECK_APOTHEM + GATE_DEPTH), 45.0 * eighth)

    def bridge(self, name: str, position: Position, eighth: int) -> Position:
        """Place a bridge with its gates to the next deck; return the position of that deck."""
        beyond = _step(position, eighth)
        self.put("gate", *_from(position, eighth, DECK_APOTHEM), 45.0 * eighth)
        self.put("gate", *_from(beyond, eighth + 4, DECK_APOTHEM), 45.0 * ((eighth + 4) % 8))
        self.put(name, *_from(position, eighth, DECK_SPACING / 2), 45.0 * eighth)
        return beyond

    def sandbox(self, position: Position, parasol: bool = False) -> None:
        """Place a sandbox on the ground."""
        self.put("sandbox", position[0], 0.0, position[1])
        if parasol:
            self.put("parasol", position[0], 0.24, position[1])


def _step(position: Position, eighth: int) -> Position:
    x, _, z = _from(position, eighth, DECK_SPACING)
    return x, z


def _from(position: Position, eighth: int, distance: float) -> tuple[float, float, float]:
    angle = np.radians(45.0 * eighth)
    return float(position[0] + distance * np.cos(angle)), 0.0, float(position[1] - distance * np.sin(angle))


def _fort() -> KitShape:
    """Build a square of decks with a wing, slides into two sandboxes, and a balance beam between them."""
    ground = _Playground()
    west, middle, east = (0.0, 0.0), (4.0, 0.0), (8.0, 0.0)
    south_west, south, far = (0.0, 4.0), (4.0, 4.0), (4.0, 8.0)
    ground.deck(west, "tent+pennant", 1)
    ground.deck(middle, "cap")
    ground.deck(east, "tent")
    ground.deck(south_west)
    ground.deck(south, "tent+pennant")
    ground.deck(far, "cap+pennant")
    ground.bridge("bridge_planks", west, 0)
    ground.bridge("bridge_tube", middle, 0)
    ground.bridge("bridge_bars", west, 6)
    ground.bridge("bridge_planks", middle, 6)
    ground.bridge("bridge_tube", south_west, 0)
    ground.bridge("bridge_bars", south, 6)
    ground.end("slide", east, 6)
    ground.end("slide", south, 0)
    ground.end("slide", far, 0)
    ground.sandbox((8.0, 4.0))
    ground.sandbox((8.0, 8.0), parasol=True)
    ground.put("balance_beam", 8.0, 0.0, 6.0, 90.0)
    ground.end("ladder", south_west, 5)
    ground.end("climbing_wall", west, 3)
    ground.end("pole", far, 4)
    ground.end("ladder", east, 1)
    return ground


def _loop() -> KitShape:
    """Build eight decks in a ring, with slides inward and outward."""
    ground = _Playground()
    positions = [(0.0, 0.0)]
    for k, name in enumerate(("planks", "bars", "tube", "planks", "tube", "planks", "bars", "tube")):
        beyond = ground.bridge(f"bridge_{name}", positions[k], k)
        if k < 7:
            positions.append(beyond)
    tops = ("tent+pennant", "cap", "", "tent", "cap+pennant", "tent+pennant", "", "tent")
    for position, top, storeys in zip(positions, tops, (0, 1, 0, 0, 2, 0, 0, 0), strict=True):
        ground.deck(position, top, storeys)
    for k in (0, 1, 4, 5):
        ground.end("slide", positions[k], 2)
        ground.sandbox(_step(positions[k], 2), parasol=k in (1, 5))
    for k in (0, 5):
        ground.put("balance_beam", *_from(_step(positions[k], 2), 0, DECK_SPACING / 2))
    ground.end("ladder", positions[0], 5)
    ground.end("pole", positions[2], 0)
    ground.end("climbing_wall", positions[3], 1)
    ground.end("ladder", positions[7], 4)
    return ground
