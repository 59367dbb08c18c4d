"""Ten chairs of the program that share seat and size and differ in legs, back, arms and cushion, as labelled GLBs.

python -m tests.toy_kits.program_chairs FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from pipeline.paths import write_file
from stages.programs.files import shape_glb
from stages.programs.program import find_program
from stages.programs.schema import Values

SIZE = {"scale x": 1.0, "scale y": 1.0, "scale z": 1.1, "seat_pos": 0.6, "seat_shape": 0.4}
SPINDLES = {"is_top_rail": True, "is_vertical_rail": True, "vr_count": 4}
COMB = SPINDLES | {"vr_count": 6, "vr_scale_x": 0.5, "tr_shape_1": 0.0, "back_frame_top_y_offset_pct": 0.4}
CROSS_RAILS = {"is_top_rail": False, "is_vertical_rail": False, "cr_count": 3, "cr_scale_z": 1.6, "cr_shape_1": 1.0}
SLATS = CROSS_RAILS | {
    "cr_count": 5,
    "cr_scale_z": 1.0,
    "cr_offset_bottom": 0.3,
    "cr_offset_top": 0.9,
    "cr_shape_1": 0.0,
}
PANEL = {"is_top_rail": True, "is_back_rest": True}
LEANING = PANEL | {"curvature": 0.5, "tr_shape_1": 0.0, "tr_scale_z": 0.75, "back_frame_top_y_offset_pct": 0.4}

STRAIGHT = {"legs_shape_1": 1.0, "legs_shape_2": 1.0, "legs_bevel": 0.0}
TURNED = {"legs_shape_1": 0.0, "legs_shape_2": 0.5, "legs_bevel": 1.0}
WAISTED = {"legs_shape_1": 0.5, "legs_shape_2": 0.0, "legs_bevel": 0.5, "back_leg_bottom_y_offset_pct": 0.4}
CURVED = {"legs_shape_1": 0.0, "legs_shape_2": 1.0, "legs_bevel": 0.0, "back_leg_mid_y_offset_pct": 0.6}
STAR = {"is_monoleg": True, "is_monoleg_tent": True, "monoleg_tent_count": 5, "legs_shape_1": 0.5}
CROSS = STAR | {"monoleg_tent_count": 4, "monoleg_tent_pct": 0.6, "legs_shape_1": 0.0}

NO_ARMS = {"handles_state": 0}
PADDED = {"handles_state": 1, "is_handles_support": True, "is_handles_cusion": True}
BARE = PADDED | {"is_handles_cusion": False, "handles_support_mid_x": 0.2, "handles_edge_pos_x_pct": 0.2}

BOARD, FLAT, PUFFED = ({"pillow_state": state} for state in range(3))

CHAIRS: tuple[Values, ...] = (
    SIZE | SPINDLES | STRAIGHT | PADDED | FLAT,
    SIZE | COMB | TURNED | NO_ARMS | BOARD,
    SIZE | SLATS | WAISTED | BARE | FLAT,
    SIZE | CROSS_RAILS | CURVED | NO_ARMS | PUFFED,
    SIZE | PANEL | TURNED | PADDED | FLAT,
    SIZE | SPINDLES | CURVED | NO_ARMS | BOARD,
    SIZE | LEANING | WAISTED | BARE | PUFFED,
    SIZE | PANEL | STAR | PADDED | PUFFED,
    SIZE | LEANING | CROSS | BARE | FLAT,
    SIZE | SLATS | STAR | PADDED | PUFFED,
)
"""What is not said of a chair stands at its base."""


def write_chairs(folder: Path, count: int = len(CHAIRS)) -> tuple[Path, ...]:
    """The first chairs as GLB files, a node a part, named by label and number."""
    program = find_program("chair")
    return tuple(
        write_file(folder / f"chair{number:02d}.glb", shape_glb(program, {**program.schema.base, **said}))
        for number, said in enumerate(CHAIRS[:count])
    )


if __name__ == "__main__":
    for path in write_chairs(Path(sys.argv[1])):
        print(path)
