"""Upright coordinates, boxes and normalization."""

from __future__ import annotations

import numpy as np
import pytest

from stages.points.frame import assembly_bounds, normalization, upright
from stages.shape.kit import Assembly, Grammar, Kit, PartType

SLAB = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3]], dtype=np.int32)


def slab_kit(up: str) -> Kit:
    colors = np.zeros((3, 3), dtype=np.uint8)
    slab = PartType("slab", SLAB, FACES, colors, np.eye(4), np.eye(4)[None])
    return Kit(
        name="slabs",
        types=(slab,),
        exemplars=(),
        grammar=Grammar({}, (), {}),
        contact_tolerance=0.001,
        pose_tolerance=0.01,
        contact_kinds=("point", "line", "face"),
        up="z" if up == "z" else "y",
    )


def two_slabs() -> Assembly:
    quarter_turn = np.array([[0.0, -1.0, 0.0, 10.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return Assembly(
        np.zeros(2, dtype=np.int16), np.stack([np.eye(4), quarter_turn]), np.array([[0, 1]], dtype=np.int32)
    )


def test_a_z_up_kit_stands_upright_and_a_y_up_kit_stays() -> None:
    assembly = two_slabs()
    assert upright(assembly, slab_kit("y")) is assembly
    turned = upright(assembly, slab_kit("z")).poses
    assert (turned[0] @ [0, 0, 4, 1]).tolist() == [0, 4, 0, 1]
    assert (turned[0] @ [0, 1, 0, 1]).tolist() == [0, 0, -1, 1]
    assert np.linalg.det(turned[1][:3, :3]) == 1.0
    assert not np.signbit(turned[turned == 0]).any()


def test_bounds_are_those_of_the_moved_vertices() -> None:
    assert assembly_bounds(slab_kit("y").types, two_slabs()).tolist() == [[0, 0, 0], [10, 2, 4]]


@pytest.mark.parametrize(("mode", "scale"), [("none", 1.0), ("unit_box", 0.1), ("unit_sphere", 1 / 30**0.5)])
def test_normalization_centres_the_box_and_scales_its_longest_side_or_farthest_vertex(mode: str, scale: float) -> None:
    moved = normalization(slab_kit("y").types, two_slabs(), mode)  # type: ignore[arg-type]
    assert moved.centre == ((0.0, 0.0, 0.0) if mode == "none" else (5.0, 1.0, 2.0))
    assert moved.scale == pytest.approx(scale)
