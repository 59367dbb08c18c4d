"""The program of cabinets (geocode §5): columns with doors and drawers, or open with shelves, on a base of its own."""

from __future__ import annotations

import numpy as np

from stages.programs.conditions import Condition
from stages.programs.curves import (
    Part,
    Profile,
    QuadMesh,
    Style,
    extrude,
    line,
    loft_rings,
    square_circle,
    sweep,
    symmetric,
    translation,
)
from stages.programs.library.cabinet_dimensions import CabinetDimensions, block
from stages.programs.library.cabinet_fronts import front_parts
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values

OAK, SHADE, DARK = (205, 172, 128), (184, 150, 106), (84, 66, 54)

BOARD_OVERLAP = 0.004
"""Depth to which boards reach into each other, in metres."""

CORNER_SEGMENTS = 6

SIDEWAYS_TRANSFORM = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Maps x and z of an upright extrusion to z and y, and its height to x."""


def build(values: Values) -> list[Part]:
    """Build the parts of the cabinet at `values`."""
    cabinet = CabinetDimensions(values)
    return [
        *case_parts(cabinet),
        *top_parts(cabinet),
        *cabinet_base_parts(cabinet),
        *shelf_parts(cabinet),
        *front_parts(cabinet),
    ]


OPEN, CLOSED = "open_columns > 0", "open_columns < column_count"
DRAWERS = "drawer_rows > 0 and open_columns < column_count"

PARAMETERS = (
    continuous("column_width", 0.3, 0.7, 5, 0.5, "case", "Width of each column between its boards, in metres."),
    continuous("height", 0.7, 2.1, 8, 1.1, "case", "Height of the whole, in metres."),
    continuous("depth", 0.3, 0.6, 5, 0.45, "case", "Depth of the case, in metres."),
    continuous("board_thickness", 0.015, 0.039, 4, 0.023, "case", "Thickness of the boards, in metres."),
    binary("has_back", True, "case", "Whether the case is shut behind."),
    continuous("top_thickness", 0.018, 0.048, 4, 0.028, "top", "Thickness of the top, in metres."),
    continuous("top_overhang", 0, 0.06, 4, 0.02, "top", "How far the top stands out, in metres."),
    binary("has_crown", False, "top", "Whether a moulding flares below the top."),
    continuous("edge_roundness", 0, 1, 4, 0.3333, "top", "How round the edges of the top and of plain fronts are."),
    discrete("base_kind", 0, 2, 1, "base", "The base: a plinth, legs, or runners."),
    continuous("base_height", 0.04, 0.24, 6, 0.12, "base", "Height of the base, in metres."),
    continuous("base_inset", 0, 1, 4, 0.3333, "base", "How far the base is set back."),
    continuous("leg_taper", 0, 1, 4, 0.6667, "base", "How thin the legs get.", "base_kind == 1"),
    continuous("leg_roundness", 0, 1, 3, 1, "base", "Section of the legs, from square to round.", "base_kind == 1"),
    discrete("column_count", 1, 4, 3, "columns", "Number of columns."),
    discrete("open_columns", 0, 3, 1, "columns", "How many of them have no fronts."),
    discrete("shelf_count", 0, 4, 2, "columns", "Number of shelves in each open column.", OPEN),
    discrete("drawer_rows", 0, 4, 2, "fronts", "Number of drawers in each closed column.", CLOSED),
    continuous("drawer_share", 0, 1, 5, 0.25, "fronts", "How much of the column the drawers fill.", DRAWERS),
    binary("has_drawers_on_top", True, "fronts", "Whether drawers are above the doors, or below.", DRAWERS),
    discrete("door_style", 0, 3, 1, "fronts", "Doors: plain, framed, with slats, or glazed.", CLOSED),
    binary("has_inset_fronts", False, "fronts", "Whether fronts lie within the case, or cover it.", CLOSED),
    discrete("handle_type", 0, 2, 1, "handles", "Handles: a knob, a bar, or a bow.", CLOSED),
    continuous("handle_size", 0, 1, 5, 0.25, "handles", "Size of the handles.", CLOSED),
    continuous("handle_height", 0, 1, 5, 0.5, "handles", "How high on its door a handle sits.", CLOSED),
)

PROGRAM = Program(
    name="cabinet",
    description="A cabinet of columns with doors and drawers, or open with shelves.",
    parameters=PARAMETERS,
    labels=(
        *("side", "bottom", "back", "divider", "shelf", "rail", "top", "crown"),
        *("plinth", "leg", "runner", "door", "drawer", "glass", "handle"),
    ),
    build=build,
    constraints=(
        Constraint(
            "open_of_all",
            Condition("open_columns <= column_count"),
            "No more columns can be open than there are columns.",
        ),
    ),
)


def case_parts(cabinet: CabinetDimensions) -> list[Part]:
    """Sides, bottom, dividers and back; the boards between the sides are a millimetre behind their front edges."""
    top, inner = cabinet.ceiling + BOARD_OVERLAP, cabinet.half - cabinet.board
    side = block((-cabinet.half, cabinet.floor, cabinet.back), (-inner, top, cabinet.front))
    floor = block(
        (-inner - BOARD_OVERLAP, cabinet.floor, cabinet.back),
        (inner + BOARD_OVERLAP, cabinet.floor + cabinet.board, cabinet.front - 0.001),
    )
    parts = [*symmetric([Part("side", side, OAK)], "x"), Part("bottom", floor, OAK)]
    behind = cabinet.back
    if cabinet.values["has_back"]:
        behind = cabinet.back + 0.008
        panel = block(
            (-inner - BOARD_OVERLAP, cabinet.floor + cabinet.board - BOARD_OVERLAP, cabinet.back),
            (inner + BOARD_OVERLAP, top, behind),
        )
        parts.append(Part("back", panel, SHADE))
    for column in cabinet.columns[1:]:
        right, bottom = column.low
        low = (right - cabinet.board, bottom - BOARD_OVERLAP, behind - BOARD_OVERLAP * bool(cabinet.values["has_back"]))
        parts.append(Part("divider", block(low, (right, top, cabinet.front - 0.001)), OAK))
    return parts


def shelf_parts(cabinet: CabinetDimensions) -> list[Part]:
    """The shelves of the open columns."""
    shelves = []
    count = cabinet.values["shelf_count"]
    thick = min(cabinet.board, 0.024)
    for column, is_open in zip(cabinet.columns, cabinet.is_open, strict=True):
        for shelf in range(count if is_open else 0):
            level = column.low[1] + (column.size[1] * (shelf + 1)) / (count + 1)
            low = (column.low[0] - BOARD_OVERLAP, level - thick / 2.0, cabinet.back + 0.004)
            high = (column.high[0] + BOARD_OVERLAP, level + thick / 2.0, cabinet.front - 0.012)
            shelves.append(Part("shelf", block(low, high), SHADE))
    return shelves


def top_parts(cabinet: CabinetDimensions) -> list[Part]:
    """The top, flush with the wall behind, and the crown under it."""
    values = cabinet.values
    thick, flare = values["top_thickness"], 0.7 * cabinet.crown
    out = values["top_overhang"] + flare
    bevel = 0.45 * thick * values["edge_roundness"]
    # It grows, or the case would show at its round front corners.
    radius = 0.14 * values["edge_roundness"]
    out += (1.0 - np.sqrt(0.5)) * (radius - bevel) + bevel
    outline = _rounded_in_front(cabinet.half + out, cabinet.back, cabinet.face + out, radius)
    mesh = extrude(outline, thick, base=values["height"] - thick, bevel=bevel, steps=3)
    parts = [Part("top", mesh, OAK)]
    if cabinet.crown:
        parts.append(Part("crown", _crown(cabinet, flare), OAK))
    return parts


def _rounded_in_front(half: float, back: float, front: float, radius: float) -> Profile:
    """A rectangle from -half to half and from back to front, with round front corners."""
    turn = np.linspace(0.0, np.pi / 2.0, CORNER_SEGMENTS + 1)
    corner = np.stack([np.cos(turn) - 1.0, np.sin(turn) - 1.0], axis=1) * radius + [half, front]
    return Profile.of(np.concatenate([[[-half, back], [half, back]], corner, corner[::-1] * [-1.0, 1.0]]))


def _crown(cabinet: CabinetDimensions, flare: float) -> QuadMesh:
    """A cove between two fillets, flaring to the front and to both sides."""
    turn = np.linspace(0.0, np.pi / 2.0, 6)
    out = np.concatenate([[0.0], 0.12 + 0.68 * (1.0 - np.cos(turn)), [1.0, 1.0]]) * flare
    rise = np.concatenate([[0.0], 0.08 + 0.72 * np.sin(turn), [0.86, 1.05]]) * cabinet.crown
    # Top down, counter-clockwise in the plane of x and z.
    out, rise = out[::-1], rise[::-1]
    rings = np.empty((len(out), 4, 3))
    rings[:, [0, 3], 0], rings[:, [1, 2], 0] = (cabinet.half + out)[:, None], -(cabinet.half + out)[:, None]
    rings[..., 1] = (cabinet.ceiling + rise)[:, None]
    rings[:, :2, 2], rings[:, 2:, 2] = (cabinet.face + out)[:, None], cabinet.back
    return loft_rings(rings)


def cabinet_base_parts(cabinet: CabinetDimensions) -> list[Part]:
    """A plinth, legs or runners."""
    kind = cabinet.values["base_kind"]
    inset = 0.1 * cabinet.values["base_inset"]
    top = cabinet.floor + min(BOARD_OVERLAP, cabinet.board / 3.0)
    if kind == 0:
        low, high = (
            (0.005 + inset - cabinet.half, 0.0, cabinet.back),
            (cabinet.half - 0.005 - inset, top, cabinet.front - inset),
        )
        return [Part("plinth", block(low, high), DARK)]
    thick = 0.065 + 0.03 * cabinet.half if kind == 1 else 0.03
    x, z = cabinet.half - thick / 2.0 - 0.006 - inset, cabinet.front - thick / 2.0 - 0.006 - 0.6 * inset
    if kind == 2:
        return symmetric([Part("runner", _runner(x, z, thick, top), DARK)], "x")
    # A square is as wide as the leg; a circle is smaller.
    section = square_circle(cabinet.values["leg_roundness"], (1.0 - 0.12 * cabinet.values["leg_roundness"]) * thick)
    style = Style.taper(1.0 - 0.6 * cabinet.values["leg_taper"], 1.0)
    # A wide cabinet also has a pair of legs in its middle.
    sides = [(x, z), (x, -z), (-x, z), (-x, -z), *([(0.0, z), (0.0, -z)] if cabinet.half > 0.9 else [])]
    return [
        Part("leg", sweep(line((across, 0.0, along), (across, top, along)), section, style), DARK)
        for across, along in sides
    ]


def _runner(x: float, z: float, thick: float, top: float) -> QuadMesh:
    """A flat bar on the ground with a post at each end."""
    end, post, bar = z + thick / 2.0, z - thick / 2.0, min(0.5 * top, thick)
    # Seen from the side: along z, and upwards.
    side = [(-end, 0.0), (end, 0.0), (end, top), (post, top), (post, bar), (-post, bar), (-post, top), (-end, top)]
    mesh = extrude(Profile.of(side), thick, base=-thick / 2.0)
    return mesh.transformed(translation(x, 0.0, 0.0) @ SIDEWAYS_TRANSFORM)
