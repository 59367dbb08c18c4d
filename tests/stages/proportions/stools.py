"""A stool of known sizes: a top and a board on two frames, each in one piece."""

from __future__ import annotations

from functools import cache

import trimesh

from stages.proportions.warp import Lattice, lattice_of
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

FRAME = trimesh.util.concatenate(
    [box(0.1, 1.0, 0.1).apply_translation((x, 0.5, 0.0)) for x in (0.05, 0.95)]
    + [box(0.8, 0.1, 0.1).apply_translation((0.5, 0.75, 0.0))]
)
"""Two posts and, at three quarters of their height, a bar between them: in one piece; its bar is at no end of it."""

MESHES = {"top": box(1.0, 0.1, 0.6), "frame": FRAME, "board": box(0.8, 0.05, 0.5)}
STOOL: list[Placed] = [
    ("frame", pose(-0.5, 0.0, 0.0)),
    ("frame", pose(-0.5, 0.0, 0.5)),
    ("top", pose(0.0, 1.05, 0.25)),
    ("board", pose(0.0, 0.825, 0.25)),
]


@cache
def kit() -> Kit:
    return kit_of(MESHES, [STOOL], ("point", "line", "face"))


def whole() -> Assembly:
    return kit().exemplars[0].whole


@cache
def lattice() -> Lattice:
    return lattice_of(kit_shape(kit(), whole()), kit().contact_tolerance)
