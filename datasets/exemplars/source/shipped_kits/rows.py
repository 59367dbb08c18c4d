"""Models with rows of congruent parts: a dresser of drawers, a bridge of arches, a terraced house of windows."""

from __future__ import annotations

import numpy as np

from shipped_kits.kit_shape import KitShape
from shipped_kits.outlines import arch, chamfered, rectangle
from shipped_kits.solids import Color, Solid, bar, box, extruded, joined, revolved, stacked

OAK, OAK_DARK, OAK_LIGHT = (176, 124, 78), (132, 90, 56), (202, 154, 104)
PAINT, PAINT_DARK, BRASS = (92, 124, 122), (70, 98, 98), (206, 168, 92)
STONE, STONE_LIGHT, STONE_DARK = (188, 178, 160), (212, 203, 186), (146, 136, 122)
ASPHALT, CAST_IRON, LAMP = (96, 98, 104), (52, 58, 62), (250, 224, 150)
BRICK, BRICK_DARK, CREAM, SLATE = (178, 96, 76), (148, 78, 62), (236, 226, 206), (84, 92, 106)
GLASS, SHUTTER, DOOR = (126, 160, 178), (66, 110, 92), (150, 52, 48)

COURSE_HEIGHT = 0.75
"""Of the stones of a pier."""


def shapes() -> dict[str, KitShape]:
    """Return the dresser, the bridge and the house by name."""
    return {"dresser": _dresser(), "bridge": _bridge(), "house": _terrace()}


def _dresser(columns: int = 3, rows: int = 3) -> KitShape:
    """Put drawers between upright boards and rails; each bay is 4.2 wide and 2.2 high, boards are .2 thick."""
    across, up, thick, deep = 4.2, 2.2, 0.2, 4.0
    width, height = columns * across + thick, rows * up + thick
    foot = revolved([(0.3, 0.0), (0.36, 0.12), (0.34, 0.3), (0.22, 0.5), (0.3, 0.7)], 8, OAK_DARK)
    drawer = box((across - thick, up - thick, deep - 0.1), (0.0, 0.0, 0.05), PAINT)
    drawer = drawer.inset((0.0, 1.0, deep / 2), rectangle(3.4, 1.4), -0.12, PAINT_DARK, PAINT, shrink=0.1)
    handle = joined(
        bar((-0.5, 0.0, 0.28), (0.5, 0.0, 0.28), 0.07, BRASS),
        bar((-0.4, 0.0, 0.0), (-0.4, 0.0, 0.3), 0.05, BRASS),
        bar((0.4, 0.0, 0.0), (0.4, 0.0, 0.3), 0.05, BRASS),
    )
    dresser = KitShape(
        {
            "foot": foot,
            "plinth": box((width + 0.2, 0.3, deep + 0.1), (0.0, 0.0, 0.0), OAK_DARK),
            "upright": box((thick, height, deep), (0.0, 0.0, 0.0), OAK),
            "rail": box((across - thick, thick, deep), (0.0, 0.0, 0.0), OAK_LIGHT),
            "drawer": drawer,
            "handle": handle,
            "top": box((width + 0.6, 0.3, deep + 0.4), (0.0, 0.0, 0.0), OAK, bevel=0.1),
        }
    )
    for x in (0.4 - width / 2, width / 2 - 0.4):
        for z in (-1.6, 1.6):
            dresser.put("foot", x, 0.0, z)
    dresser.put("plinth", 0.0, 0.7, 0.0)
    for column in range(columns + 1):
        dresser.put("upright", across * (column - columns / 2), 1.0, 0.0)
    for column in range(columns):
        x = across * (column - (columns - 1) / 2)
        for row in range(rows + 1):
            dresser.put("rail", x, 1.0 + up * row, 0.0)
        for row in range(rows):
            dresser.put("drawer", x, 1.0 + thick + up * row, 0.0)
            dresser.put("handle", x, 1.0 + thick + up * row + 1.0, deep / 2 + 0.12)
    dresser.put("top", 0.0, 1.0 + height, 0.1)
    return dresser


def _bridge(spans: int = 4, courses: int = 3) -> KitShape:
    """Put arches between piers of courses, 6 apart, under one roadway, with parapets and lamps above each pier."""
    span, broad, wide = 6.0, 1.2, 4.0
    springing = 0.7 + courses * COURSE_HEIGHT
    crown = springing + 2.6
    length = spans * span + broad
    clear = span - broad
    opening = arch(clear, crown - springing - 0.5, crown - springing - 0.5, 10)
    outline = np.concatenate([[[clear / 2, crown - springing], [-clear / 2, crown - springing]], opening[2:][::-1]])
    spandrel = extruded(outline, -wide / 2, wide / 2, STONE)
    spandrel = spandrel.tinted(
        STONE_DARK, lambda _, corners: bool(np.ptp(corners[:, 2]) > 1.0 and corners[:, 1].max() < crown - springing)
    )
    foot = stacked(chamfered(broad + 0.6, wide + 1.6, 0.6), [(0.0, 0.0), (0.0, 0.5), (-0.2, 0.7)], STONE_DARK)
    course = stacked(
        chamfered(broad, wide + 1.0, 0.5),
        [(-0.04, 0.0), (0.0, 0.06), (0.0, COURSE_HEIGHT - 0.06), (-0.04, COURSE_HEIGHT)],
        [STONE_DARK, STONE_LIGHT, STONE_DARK],
    )
    parapet = box((span - 0.5, 0.9, 0.4), (0.0, 0.0, 0.0), STONE, bevel=0.08)
    for x in (-1.8, -0.6, 0.6, 1.8):
        parapet = parapet.inset((x, 0.42, 0.2), arch(0.5, 0.5, 0.25, 4, y=-0.25), 0.1, STONE_DARK, copies=2)
    post = box((0.5, 1.2, 0.5), (0.0, 0.0, 0.0), STONE_LIGHT, bevel=0.1)
    lamp = joined(
        revolved([(0.12, 0.0), (0.12, 0.3), (0.06, 0.4), (0.05, 2.0), (0.12, 2.1)], 6, CAST_IRON),
        revolved([(0.14, 2.1), (0.24, 2.6)], 6, LAMP),
        revolved([(0.28, 2.6), (0.1, 2.8), (0.0, 3.0)], 6, CAST_IRON),
    )
    road = joined(
        box((length, 0.4, wide + 0.6), (0.0, 0.0, 0.0), STONE_LIGHT),
        box((length, 0.04, wide - 0.8), (0.0, 0.4, 0.0), ASPHALT),
    )
    bank = np.array([[0.0, 0.0], [7.0, 0.0], [7.0, crown - 0.6], [0.0, crown]])
    bridge = KitShape(
        {
            "foot": foot,
            "course": course,
            "pier": box((broad, crown - springing, wide), (0.0, 0.0, 0.0), STONE_LIGHT),
            "arch": spandrel,
            "road": road,
            "parapet": parapet,
            "post": post,
            "lamp": lamp,
            "abutment": extruded(bank, -(wide + 0.6) / 2, (wide + 0.6) / 2, STONE_DARK),
        }
    )
    start = -spans * span / 2
    for k in range(spans + 1):
        bridge.put("foot", start + span * k, 0.0, 0.0)
        for course_number in range(courses):
            bridge.put("course", start + span * k, 0.7 + COURSE_HEIGHT * course_number, 0.0)
        bridge.put("pier", start + span * k, springing, 0.0)
        for z in (-1.0, 1.0):
            bridge.put("post", start + span * k, crown + 0.4, 2.1 * z)
            bridge.put("lamp", start + span * k, crown + 1.6, 2.1 * z)
    for k in range(spans):
        bridge.put("arch", start + span * (k + 0.5), springing, 0.0)
        for z in (-1.0, 1.0):
            bridge.put("parapet", start + span * (k + 0.5), crown + 0.4, 2.1 * z)
    bridge.put("road", 0.0, crown, 0.0)
    bridge.put("abutment", length / 2, 0.0, 0.0)
    bridge.put("abutment", -length / 2, 0.0, 0.0, 180.0)
    return bridge


def _terrace(bays: int = 4, storeys: int = 3) -> KitShape:
    """Put windows with shutters on the front of a wall, 3 apart and 3.2 from storey to storey, a door among them."""
    apart, up, deep = 3.0, 3.2, 7.0
    width, height = bays * apart + 0.6, storeys * up + 0.4
    front = deep / 2
    gable = np.array([[-front - 0.5, 0.0], [front + 0.5, 0.0], [0.0, 3.4]])
    roof = extruded(gable, -width / 2 - 0.4, width / 2 + 0.4, SLATE).rotated(90.0)
    terrace = KitShape(
        {
            "step": box((1.9, 0.3, 0.9), (0.0, 0.0, 0.45), STONE, bevel=0.05),
            "wall": box((width, height, deep), (0.0, 0.0, 0.0), BRICK),
            "cornice": box((width, 0.24, 0.16), (0.0, 0.0, 0.08), CREAM, bevel=0.04),
            "window": _window(),
            "shutter": _shutter(),
            "door": _door(),
            "roof": roof,
            "dormer": _dormer(),
            "chimney": _chimney(),
        }
    )
    terrace.put("wall", 0.0, 0.0, 0.0)
    for storey in range(storeys):
        terrace.put("cornice", 0.0, up * storey + 3.1, front)
        for bay in range(bays):
            x = apart * (bay - (bays - 1) / 2)
            if storey == 0 and bay == 1:
                terrace.put("step", x, 0.0, front)
                terrace.put("door", x, 0.3, front)
                continue
            terrace.put("window", x, up * storey + 0.9, front)
            for side in (-1.0, 1.0):
                terrace.put("shutter", x + 0.93 * side, up * storey + 0.95, front)
    terrace.put("roof", 0.0, height, 0.0)
    for bay in range(bays - 1):
        terrace.put("dormer", apart * (bay - (bays - 2) / 2), height, 0.0)
    for side in (-1.0, 1.0):
        terrace.put("chimney", side * (width / 2 - 0.7), height, 0.0)
    return terrace


def _window() -> Solid:
    frame = box((1.3, 1.9, 0.14), (0.0, 0.0, 0.07), CREAM)
    for x in (-0.29, 0.29):
        for y in (0.52, 1.38):
            frame = frame.inset((x, y, 0.14), rectangle(0.46, 0.72), 0.06, CREAM, GLASS)
    return frame + box((1.6, 0.12, 0.26), (0.0, -0.12, 0.13), STONE)


def _shutter() -> Solid:
    shutter = box((0.5, 1.8, 0.1), (0.0, 0.0, 0.05), SHUTTER)
    for y in (0.5, 1.3):
        shutter = shutter.inset((0.0, y, 0.1), rectangle(0.3, 0.6), 0.04, _darker(SHUTTER))
    return shutter


def _door() -> Solid:
    frame = box((1.6, 2.7, 0.2), (0.0, 0.0, 0.1), CREAM)
    leaf = frame.inset((0.0, 1.1, 0.2), rectangle(1.1, 1.9), 0.1, CREAM, DOOR)
    leaf = leaf.inset((0.0, 2.34, 0.2), rectangle(1.1, 0.32), 0.1, CREAM, GLASS)
    return leaf + bar((0.4, 1.1, 0.1), (0.4, 1.1, 0.24), 0.06, BRASS)


def _dormer() -> Solid:
    """Build a dormer on the front slope of the roof, whose foot is at the height of the eaves."""
    front, back, foot, eaves = 3.0, 0.6, 0.5, 2.0
    walls = box((1.4, eaves - foot, front - back), (0.0, foot, (front + back) / 2), CREAM)
    walls = walls.inset((0.0, 1.4, front), rectangle(0.9, 0.8), 0.08, STONE_LIGHT, GLASS)
    gable = np.array([[-0.9, eaves], [0.9, eaves], [0.0, eaves + 0.8]])
    return walls + extruded(gable, back, front + 0.2, _darker(SLATE))


def _chimney() -> Solid:
    stack = box((0.8, 3.4, 1.2), (0.0, 1.4, 0.0), BRICK_DARK) + box((1.0, 0.3, 1.4), (0.0, 4.8, 0.0), STONE)
    for z in (-0.3, 0.3):
        stack = stack + revolved([(0.18, 5.1), (0.14, 5.6)], 8, BRICK).translated(0.0, 0.0, z)
    return stack


def _darker(color: Color) -> Color:
    red, green, blue = (int(0.8 * value) for value in color)
    return (red, green, blue)
