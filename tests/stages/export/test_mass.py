"""Masses against closed forms and trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from stages.export.mass import part_masses
from stages.shape.kit import Assembly
from stages.shape.shape import Shape
from tests.stages.export.models import mesh


def turned(rng: np.random.Generator) -> np.ndarray:
    pose = trimesh.transformations.random_rotation_matrix(rng.random(3))
    pose[:3, 3] = rng.normal(size=3)
    return pose


def shape_of(solid: trimesh.Trimesh, pose: np.ndarray) -> Shape:
    assembly = Assembly(np.zeros(1, np.int16), pose[None], np.empty((0, 2), np.int32))
    return Shape((mesh("part", solid),), assembly, "y", ("part",))


@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.box((0.3, 1.0, 2.5)),
        trimesh.creation.cone(0.7, 2.0, sections=13),
        trimesh.creation.annulus(0.4, 0.9, 0.6, sections=11),
    ],
)
def test_mass_centre_and_inertia_of_a_solid_are_those_of_trimesh(solid: trimesh.Trimesh) -> None:
    pose = turned(np.random.default_rng(3))
    mass, centre, inertia = part_masses(shape_of(solid, pose), 700.0, 0.01).combined([0])
    placed = solid.copy().apply_transform(pose)
    placed.density = 700.0
    assert mass == pytest.approx(placed.mass)
    np.testing.assert_allclose(centre, placed.center_mass, atol=1e-9)
    np.testing.assert_allclose(inertia, placed.moment_inertia, rtol=1e-9, atol=1e-9)


def test_an_open_part_weighs_by_its_area_as_a_thin_shell() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    sphere.update_faces(np.arange(len(sphere.faces)) > 0)
    mass, centre, inertia = part_masses(shape_of(sphere, np.eye(4)), 1000.0, 0.001).combined([0])
    assert mass == pytest.approx(np.pi * 1000.0 * 0.001, rel=0.01)
    np.testing.assert_allclose(centre, np.zeros(3), atol=1e-3)
    np.testing.assert_allclose(inertia, np.eye(3) * 2 / 3 * mass * 0.25, rtol=0.01, atol=1e-3)


def test_parts_of_one_body_add_up_to_the_body_in_one_piece() -> None:
    halves = trimesh.creation.box((1.0, 0.4, 0.6))
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, 0, 3] = [-0.5, 0.5]
    assembly = Assembly(np.zeros(2, np.int16), poses, np.empty((0, 2), np.int32))
    two = part_masses(Shape((mesh("half", halves),), assembly, "y", ("half",)), 600.0, 0.01).combined([0, 1])
    whole = part_masses(shape_of(trimesh.creation.box((2.0, 0.4, 0.6)), np.eye(4)), 600.0, 0.01).combined([0])
    for part, expected in zip(two, whole, strict=True):
        np.testing.assert_allclose(part, expected, atol=1e-12)
