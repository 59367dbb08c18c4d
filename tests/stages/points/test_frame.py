"""Boxes and normalization."""

from __future__ import annotations

import numpy as np
import pytest

from stages.points.cloud import normalization
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

SLAB = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3]], dtype=np.int32)


def two_slabs() -> Shape:
    colors = np.zeros((3, 3), dtype=np.uint8)
    quarter_turn = np.array([[0.0, -1.0, 0.0, 10.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    poses, edges = np.stack([np.eye(4), quarter_turn]), np.array([[0, 1]], dtype=np.int32)
    slab = PartMesh("slab", SLAB, FACES, colors)
    return Shape((slab,), Assembly(np.zeros(2, dtype=np.int16), poses, edges), "y", ("slab",))


def test_bounds_are_those_of_the_moved_vertices() -> None:
    assert shape_bounds(two_slabs()).tolist() == [[0, 0, 0], [10, 2, 4]]


@pytest.mark.parametrize(("mode", "scale"), [("none", 1.0), ("unit_box", 0.1), ("unit_sphere", 1 / 30**0.5)])
def test_normalization_centres_the_box_and_scales_its_longest_side_or_farthest_vertex(mode: str, scale: float) -> None:
    moved = normalization(two_slabs(), mode)  # type: ignore[arg-type]
    assert moved.centre == ((0.0, 0.0, 0.0) if mode == "none" else (5.0, 1.0, 2.0))
    assert moved.scale == pytest.approx(scale)
