from __future__ import annotations

import numpy as np
import pytest

from stages.exemplars.congruence import comparable_mesh, congruences
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.pose import invert
from stages.shape.kit import Docking, PartType
from tests.stages.shape.geometry.bodies import Body, box, hull, part, placed, random_rotation

POSE_TOLERANCE = 0.01


def symmetric_part(body: Body) -> PartType:
    vertices, faces = body
    shape = comparable_mesh(vertices, faces)
    return part(body, symmetries=congruences(shape, shape, 1e-4, reflections=False))


def docking(pose: np.ndarray, a: int = 0, b: int = 0) -> Docking:
    return Docking(a, b, pose, "face", 1, 0.0)


def lopsided(seed: int = 1) -> PartType:
    return part(hull(np.random.default_rng(seed)))


def test_images_are_all_poses_that_look_the_same() -> None:
    cube, brick = symmetric_part(box()), symmetric_part(box(1, 2, 3))
    images = symmetric_images(cube, brick, placed(1.5, 0.2, 0.1))
    assert len(images) == 24 * 4
    looks = {
        tuple(np.round(np.sort((image[:3, :3] @ brick.vertices.T).T + image[:3, 3], axis=0).ravel(), 6))
        for image in images
    }
    assert len(looks) == 24, "turning the cube moves the brick about it, turning the brick in itself shows nothing"
    for image in images:
        np.testing.assert_allclose(sorted(np.abs(image[:3, 3])), [0.1, 0.2, 1.5], atol=1e-12)


def test_a_pose_and_all_its_images_have_one_label_and_others_have_none() -> None:
    cube, brick = symmetric_part(box()), symmetric_part(box(1, 2, 3))
    pose = placed(1.0, 0.2, 0.1)
    table = DockingTable([cube, brick], [docking(pose, 0, 1)], POSE_TOLERANCE)
    images = symmetric_images(cube, brick, pose)
    assert table.label(0, 1, images).tolist() == [0] * len(images)
    assert table.label(1, 0, invert(images)).tolist() == [1] * len(images)
    off = images.copy()
    off[:, :3, 3] += [0.0, 0.0, 0.02]
    assert (table.label(0, 1, off) == -1).all()
    assert (table.label(0, 0, images) == -1).all()


def test_labels_say_from_which_end_a_docking_of_one_type_is_seen() -> None:
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    pose = placed(1, 0, 0, quarter)
    table = DockingTable([lopsided()], [docking(placed(0, 5, 0)), docking(pose)], POSE_TOLERANCE)
    assert table.label(0, 0, np.array([pose, invert(pose)])).tolist() == [2, 3]
    poses = np.array([np.eye(4), pose])
    assert table.label_edges(np.zeros(2, np.int16), poses, np.array([[0, 1]], np.int32)).tolist() == [[2, 3]]
    assert table.label_edges(np.zeros(2, np.int16), poses[::-1], np.array([[0, 1]], np.int32)).tolist() == [[3, 2]]


def test_a_docking_that_looks_the_same_from_both_ends_is_even_from_both() -> None:
    half_turn = np.diag([-1.0, -1.0, 1.0])
    pose = placed(1, 0, 0, half_turn)
    np.testing.assert_allclose(invert(pose), pose)
    table = DockingTable([lopsided()], [docking(pose)], POSE_TOLERANCE)
    poses = np.array([np.eye(4), pose])
    assert table.label_edges(np.zeros(2, np.int16), poses, np.array([[0, 1]], np.int32)).tolist() == [[0, 0]]


@pytest.mark.parametrize("shift", [0.2, 0.45, 0.6])
def test_a_pose_within_tolerance_of_an_image_has_its_label_however_near_the_images_are(shift: float) -> None:
    # Seen from its other end this docking is nearly itself: its two images are `2 * shift` tolerances apart.
    pose = placed(1, 0, shift * POSE_TOLERANCE, np.diag([-1.0, -1.0, 1.0]))
    table = DockingTable([lopsided()], [docking(pose)], POSE_TOLERANCE)
    beyond = invert(pose)
    beyond[2, 3] -= 0.95 * POSE_TOLERANCE
    labels = table.label(0, 0, np.array([pose, invert(pose), beyond, invert(beyond)]))
    assert set(labels.tolist()) <= {0, 1}
    if shift < 0.5:
        assert set(labels.tolist()) == {0}


def test_labels_do_not_depend_on_how_the_assembly_stands() -> None:
    rng = np.random.default_rng(2)
    types = [symmetric_part(box()), lopsided(), symmetric_part(box(1, 1, 2))]
    known = [docking(placed(*rng.normal(size=3), random_rotation(rng)), a, b) for a in range(3) for b in range(a, 3)]
    table = DockingTable(types, known, POSE_TOLERANCE)
    for index, known_docking in enumerate(known):
        start = placed(*rng.normal(size=3) * 9, random_rotation(rng))
        turn_a = types[known_docking.a].symmetries[rng.integers(len(types[known_docking.a].symmetries))]
        turn_b = types[known_docking.b].symmetries[rng.integers(len(types[known_docking.b].symmetries))]
        poses = np.array([start @ turn_a, start @ known_docking.pose @ turn_b])
        labels = table.label_edges(
            np.array([known_docking.a, known_docking.b], np.int16), poses, np.array([[0, 1]], np.int32)
        )
        assert labels.tolist() == [[2 * index, 2 * index + 1]]
