"""Triangles, components and clouds against closed forms."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.clouds import chamfer_l1, chamfer_squared
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.triangles import area_vectors, triangle_areas, unit_normals

CORNERS = np.array(
    [[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]], [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.0]]]
)


def test_area_and_normal_of_a_right_triangle_and_of_one_without_area() -> None:
    assert area_vectors(CORNERS).tolist() == [[0.0, 0.0, 6.0], [0.0, 0.0, 0.0]]
    assert triangle_areas(CORNERS).tolist() == [3.0, 0.0]
    assert unit_normals(CORNERS).tolist() == [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]


def test_components_are_numbered_by_their_first_nodes() -> None:
    assert connected_components(6, np.array([[5, 1], [4, 2]])).tolist() == [0, 1, 2, 3, 2, 1]
    assert connected_components(3, np.empty((0, 2), dtype=np.int32)).tolist() == [0, 1, 2]
    assert connected_components(0, np.empty((0, 2), dtype=np.int32)).tolist() == []


def test_chamfer_distances_of_two_points_and_three() -> None:
    first, second = (
        np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]),
        np.array([[0.0, 0.0, 0.0], [4.0, 3.0, 0.0], [0, 1, 0]]),
    )
    assert chamfer_l1(first, second) == (0.0 + 3.0) / 2 + (0.0 + 3.0 + 1.0) / 3
    assert chamfer_squared(first, second) == (0.0 + 9.0) / 2 + (0.0 + 9.0 + 1.0) / 3
