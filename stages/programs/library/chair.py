"""The program of chairs (geocode §3.2, Figure 4): a seat on legs or on one foot, a back, arms, cushions."""

from __future__ import annotations

from collections.abc import Sequence

from stages.programs.conditions import Condition
from stages.programs.curves import Part
from stages.programs.library.chair_arms import arm_parts
from stages.programs.library.chair_back import back_parts
from stages.programs.library.chair_base import base_parts
from stages.programs.library.chair_dimensions import ChairDimensions
from stages.programs.library.chair_seat import seat_parts
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values


def build(values: Values) -> Sequence[Part]:
    """Build the parts of the chair at `values`."""
    chair = ChairDimensions(values)
    return [*seat_parts(chair), *base_parts(chair), *back_parts(chair), *arm_parts(chair)]


RAILS = "not is_back_rest"
CROSS = "not is_back_rest and (not is_top_rail or not is_vertical_rail)"
VERTICAL = "not is_back_rest and is_top_rail and is_vertical_rail"
LEGS = "(is_monoleg and is_monoleg_tent) or not is_monoleg"
STAR = "is_monoleg and is_monoleg_tent"
SUPPORT = "handles_state == 1 and is_handles_support"
FREE_ARMS = "handles_state == 1"
ARMS = "handles_state > 0"
FOOT = "is_monoleg"
FOUR_LEGS = "not is_monoleg"

PARAMETERS = (
    continuous("scale x", 0.5, 2.0, 10, 1.0, "size", "Width of the seat, in half metres."),
    continuous("scale y", 0.5, 2.0, 10, 1.0, "size", "Depth of the seat, in half metres."),
    continuous(
        "scale z", 0.5, 2.0, 10, 1.0, "size", "Height of the posts of the back above the ground, in 0.95 metres."
    ),
    continuous(
        "bevel_rails", 0.0, 1.0, 3, 0.0, "back", "Section of the rails, from square to round and turned.", RAILS
    ),
    discrete("pillow_state", 0, 2, 1, "seat", "No cushion, a flat one or a puffed one."),
    discrete(
        "pillow_fill_edge", 0, 1, 1, "seat", "Whether the cushion reaches to the edge of the seat.", "pillow_state > 0"
    ),
    continuous("seat_shape", 0.0, 1.0, 5, 0.423308789730072, "seat", "The seat from above, from square to round."),
    continuous("seat_pos", 0.2, 1.0, 9, 0.5646687746047974, "seat", "Height of the seat."),
    discrete("cr_count", 3, 8, 5, "back", "Number of cross rails.", CROSS),
    continuous("cr_scale_y", 0.5, 1.2, 4, 0.7333, "back", "Thickness of the cross rails.", CROSS),
    continuous("cr_scale_z", 0.3, 2.0, 6, 0.98, "back", "Height of each cross rail.", CROSS),
    continuous("cr_offset_bottom", 0.15, 0.75, 8, 0.4071, "back", "Where the lowest cross rail begins.", CROSS),
    continuous("cr_offset_top", 0.35, 0.95, 8, 0.7786, "back", "Where the highest cross rail ends.", CROSS),
    continuous(
        "cr_shape_1", 0.0, 2.0, 7, 0.0, "back", "How far cross rails are arched, and narrow at their ends.", CROSS
    ),
    continuous("curvature", 0.0, 1.0, 5, 0.25, "back", "How far the back bows backwards between its posts."),
    binary("is_top_rail", True, "back", "Whether a rail joins the tops of the posts."),
    discrete("tr_fill_edge", 0, 1, 1, "back", "Whether the top rail covers the posts or fits between.", "is_top_rail"),
    continuous("tr_scale_y", 0.5, 1.2, 5, 0.6800000071525574, "back", "Thickness of the top rail.", "is_top_rail"),
    continuous("tr_scale_z", 0.5, 1.5, 5, 1.3600000143051147, "back", "Height of the top rail.", "is_top_rail"),
    continuous("tr_shape_1", 0.0, 1.0, 5, 0.5525987148284912, "back", "Arch of the top rail.", "is_top_rail"),
    binary(
        "is_vertical_rail",
        True,
        "back",
        "Whether rails stand on the seat, instead of cross rails.",
        "not is_back_rest and is_top_rail",
    ),
    discrete("vr_count", 3, 8, 4, "back", "Number of vertical rails.", VERTICAL),
    continuous("vr_scale_x", 0.3, 2.0, 6, 0.7799999713897705, "back", "Width of each vertical rail.", VERTICAL),
    continuous("vr_scale_y", 0.2, 1.0, 4, 0.3499999940395355, "back", "Thickness of the vertical rails.", VERTICAL),
    continuous(
        "vr_shape_1",
        0.0,
        0.4,
        5,
        0.0,
        "back",
        "How far vertical rails bow to the front, and thin at their ends.",
        VERTICAL,
    ),
    binary("is_back_rest", False, "back", "Whether an upholstered panel fills the back, instead of rails."),
    continuous("legs_shape_1", 0.0, 1.0, 3, 1.0, "legs", "Thickness of the legs at the ground.", LEGS),
    continuous("legs_shape_2", 0.0, 1.0, 3, 1.0, "legs", "Thickness of the legs at half their height.", LEGS),
    continuous("legs_bevel", 0.0, 1.0, 3, 0.5, "legs", "Section of legs, foot and posts, from square to round."),
    binary("is_monoleg", False, "legs", "Whether the chair stands on one foot in its middle."),
    binary("is_monoleg_tent", False, "legs", "Whether that foot is a column on a star of legs.", FOOT),
    continuous("monoleg_tent_pct", 0.2, 0.8, 7, 0.4, "legs", "Height of the star, as a share of the seat's.", STAR),
    discrete("monoleg_tent_count", 3, 8, 4, "legs", "Number of legs of the star.", STAR),
    continuous("monoleg_bezier_start_x_offset", 0.0, 1.0, 6, 0.0, "legs", "Reach of the foot at its top.", FOOT),
    continuous(
        "monoleg_bezier_start_handle_x_offset",
        0,
        1,
        6,
        0.0,
        "legs",
        "Reach of the upper handle of the foot's curve.",
        FOOT,
    ),
    continuous(
        "monoleg_bezier_start_handle_z_pct",
        0,
        1,
        6,
        0.4,
        "legs",
        "How far down the upper handle of the foot's curve lies.",
        FOOT,
    ),
    continuous(
        "monoleg_bezier_end_x_offset", 0, 1, 6, 0.8199999332427979, "legs", "Reach of the foot at the ground.", FOOT
    ),
    continuous(
        "monoleg_bezier_end_handle_x_offset",
        0,
        1,
        6,
        0.4,
        "legs",
        "Reach of the lower handle of the foot's curve.",
        FOOT,
    ),
    continuous(
        "monoleg_bezier_end_handle_z_pct",
        0,
        1,
        6,
        1.0,
        "legs",
        "How far down the lower handle of the foot's curve lies.",
        FOOT,
    ),
    continuous("back_frame_top_y_offset_pct", 0.0, 1.0, 6, 0.0, "frame", "How far the posts lean back at their tops."),
    continuous("back_frame_mid_y_offset_pct", 0.0, 1.0, 6, 0.0, "frame", "How far the posts bend back half way up."),
    continuous(
        "back_leg_bottom_y_offset_pct",
        0,
        1,
        6,
        0.0,
        "frame",
        "How far back the back legs stand on the ground.",
        FOUR_LEGS,
    ),
    continuous(
        "back_leg_mid_y_offset_pct", 0, 1, 6, 0.0, "frame", "How far the back legs bend back half way down.", FOUR_LEGS
    ),
    discrete("handles_state", 0, 2, 0, "arms", "No arms, arms with free ends, or arms that curve down to the seat."),
    binary("is_handles_support", True, "arms", "Whether a support holds up each arm.", FREE_ARMS),
    binary("is_handles_cusion", True, "arms", "Whether there is a pad on each arm.", ARMS),
    continuous("handles_profile_width", 0.5, 1.0, 6, 0.9, "arms", "Width of the arms.", ARMS),
    continuous("handles_profile_height", 0.5, 1.0, 6, 0.9, "arms", "Thickness of the arms.", ARMS),
    continuous("handles_base_pos_z_pct", 0.15, 0.8, 8, 0.15, "arms", "Where the arms leave the posts.", ARMS),
    continuous("handles_mid_pos_x_pct", 0.0, 1.0, 7, 0.0, "arms", "How far the arms bow to the sides.", ARMS),
    continuous(
        "handles_mid_pos_y_pct", 0.1, 0.9, 7, 0.42329999804496765, "arms", "How far to the front the arms bow.", ARMS
    ),
    continuous("handles_mid_pos_z_pct", 0.0, 1.0, 7, 0.5, "arms", "How far the arms sag or rise.", ARMS),
    continuous(
        "handles_edge_pos_x_pct", 0, 1, 6, 0.0, "arms", "How far to the side the free ends of the arms are.", FREE_ARMS
    ),
    continuous(
        "handles_bottom_pos_along_seat_pct",
        0.3,
        0.9,
        7,
        0.4,
        "arms",
        "Where supports, or arms that curve down, meet the seat, from its back to its front.",
        "handles_state == 2 or (handles_state == 1 and is_handles_support == 1)",
    ),
    continuous(
        "handles_support_mid_x", 0.0, 1.0, 6, 0.5800000429153442, "arms", "How far supports bow to the sides.", SUPPORT
    ),
    continuous("handles_support_mid_y", 0.0, 1.0, 6, 0.0, "arms", "How far supports bow to the front.", SUPPORT),
    continuous("handles_support_top_pos", 0.3, 0.9, 7, 0.5, "arms", "Where supports meet the arms.", SUPPORT),
    continuous("handles_support_thickness", 0.4, 0.9, 7, 0.8167, "arms", "Thickness of the supports.", SUPPORT),
    continuous(
        "handles_cusion_cover_pct",
        0,
        1,
        6,
        1.0,
        "arms",
        "Length of the pads on the arms.",
        "handles_state > 0 and is_handles_cusion",
    ),
)

PROGRAM = Program(
    name="chair",
    description="A chair with a seat on four legs or one foot,"
    " a back of rails or a panel, and cushions and arms or none.",
    parameters=PARAMETERS,
    labels=(
        "seat",
        "cushion",
        "leg",
        "pedestal",
        "column",
        "hub",
        "glide",
        "back post",
        "top rail",
        "cross rail",
        "vertical rail",
        "backrest",
        "arm",
        "arm support",
        "arm pad",
    ),
    build=build,
    constraints=(
        Constraint(
            "rails_in_order",
            Condition("cr_offset_top - cr_offset_bottom >= 0.1"),
            "The highest cross rail lies above the lowest.",
        ),
        Constraint(
            "foot_stands",
            Condition("monoleg_bezier_end_x_offset >= monoleg_bezier_start_x_offset"),
            "A foot is at least as wide on the ground as at its top.",
        ),
    ),
    non_intersecting=(("arm", "cushion"),),
)
