"""The program of cabinets (geocode §5): columns with doors and drawers, or open with shelves, on a base of its own."""

from __future__ import annotations

from stages.programs.conditions import Condition
from stages.programs.curves import Part
from stages.programs.library.cabinet_case import base_parts, case_parts, shelf_parts, top_parts
from stages.programs.library.cabinet_dimensions import CabinetDimensions
from stages.programs.library.cabinet_fronts import front_parts
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values


def build(values: Values) -> list[Part]:
    """Build the parts of the cabinet at `values`."""
    cabinet = CabinetDimensions(values)
    return [
        *case_parts(cabinet),
        *top_parts(cabinet),
        *base_parts(cabinet),
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
