"""Shapes: labels and names of their parts, and which way is up."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape, upright

FACES = np.array([[0, 1, 2]], dtype=np.int32)
QUARTER = np.array([[0.0, -1.0, 0.0, 10.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def stool(up: str = "y", own_names: tuple[str, ...] = ()) -> Shape:
    """A seat and two legs, each leg a mesh of its own."""
    meshes = tuple(
        PartMesh(name, np.eye(3), FACES, np.zeros((1, 3), dtype=np.uint8)) for name in ("leg", "seat", "leg")
    )
    poses = np.stack([np.eye(4), QUARTER, np.eye(4)])
    edges = np.array([[0, 1], [1, 2]], dtype=np.int32)
    parts = Assembly(np.arange(3, dtype=np.int16), poses, edges)
    return Shape(meshes, parts, "z" if up == "z" else "y", ("seat", "back", "leg"), own_names)


def test_labels_count_into_the_vocabulary_and_not_into_the_meshes() -> None:
    assert stool().part_labels.tolist() == [2, 0, 2]
    assert stool().part_labels.dtype == np.int16


def test_parts_are_numbered_among_those_of_their_label() -> None:
    assert stool().part_names == ("leg.000", "seat.000", "leg.001")
    assert stool(own_names=("a", "b", "c")).part_names == ("a", "b", "c")


def test_a_mesh_without_a_place_in_the_vocabulary_is_an_error() -> None:
    with pytest.raises(KeyError):
        _ = Shape(stool().meshes, stool().assembly, "y", ("seat",)).part_labels


def test_a_z_up_shape_is_turned_upright_and_a_y_up_shape_stays() -> None:
    shape = stool()
    assert upright(shape) is shape
    turned = upright(stool("z"))
    poses = turned.assembly.poses
    assert turned.up == "y"
    assert (poses[0] @ [0, 0, 4, 1]).tolist() == [0, 4, 0, 1]
    assert (poses[0] @ [0, 1, 0, 1]).tolist() == [0, 0, -1, 1]
    assert np.linalg.det(poses[1][:3, :3]) == 1.0
    assert not np.signbit(poses[poses == 0]).any()
