"""Uniform points: inside their triangles, in proportion to area, on the part that their label names."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from stages.points.area_sampling import sample_shape, sample_surface, surface_table
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.kit import Assembly, PartType
from stages.shape.shape import Shape

TRIANGLE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]])


def part_type(name: str, vertices: np.ndarray, faces: np.ndarray) -> PartType:
    colors = np.full((len(faces), 3), 200, dtype=np.uint8)
    return PartType(name, vertices, faces.astype(np.int32), colors, np.eye(4), np.eye(4)[None])


def rotation(rng: np.random.Generator) -> np.ndarray:
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = turn * np.sign(np.linalg.det(turn))
    pose[:3, 3] = rng.normal(size=3) * 5
    return pose


def soup(rng: np.random.Generator, faces: int) -> tuple[np.ndarray, np.ndarray]:
    vertices = rng.normal(size=(faces + 2, 3))
    return vertices, np.array([rng.choice(faces + 2, 3, replace=False) for _ in range(faces)], dtype=np.int32)


def distance_to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance of points that project into one of the triangles, by barycentric coordinates: (n, f)."""
    origin, first, second = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    distances = np.full((len(points), len(triangles)), np.inf)
    for face in range(len(triangles)):
        edges = np.stack([first[face], second[face]], axis=1)
        shares, *_ = np.linalg.lstsq(edges, (points - origin[face]).T, rcond=None)
        apart = np.linalg.norm(edges @ shares - (points - origin[face]).T, axis=0)
        inside = (shares.min(axis=0) >= -1e-9) & (shares.sum(axis=0) <= 1 + 1e-9)
        distances[inside, face] = apart[inside]
    return distances


def test_all_points_of_one_triangle_lie_in_it_and_fill_it_evenly() -> None:
    points, normals, faces = sample_surface(
        TRIANGLE, np.array([[0, 1, 2]], dtype=np.int32), 20_000, np.random.default_rng(1)
    )
    x, y, z = points.T
    assert (x >= 0).all()
    assert (y >= 0).all()
    assert (x / 4 + y / 2 <= 1 + 1e-12).all()
    assert (z == 0).all()
    assert (normals == [0, 0, 1]).all()
    assert (faces == 0).all()
    assert np.abs(points.mean(axis=0) - TRIANGLE.mean(axis=0)).max() < 0.03
    middle = binomtest(int(((x < 2) & (y < 1) & (x / 2 + y < 1)).sum()), 20_000, 0.25)
    assert middle.pvalue > 1e-4


def test_two_triangles_are_hit_in_the_ratio_of_their_areas() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [8, 0, 0], [5, 1, 0]], dtype=float)
    _, _, faces = sample_surface(vertices, np.array([[0, 1, 2], [3, 4, 5]]), 40_000, np.random.default_rng(2))
    assert binomtest(int((faces == 0).sum()), 40_000, 0.25).pvalue > 1e-4


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 1, 0]])
def test_faces_of_zero_area_are_never_hit(order: list[int]) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 3, 2], [2, 2, 2]], dtype=np.int32)[order]
    _, normals, hit = sample_surface(vertices, faces, 5_000, np.random.default_rng(3))
    assert {order[face] for face in np.unique(hit)} == {0, 2}
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)


@pytest.mark.parametrize("vertices", [np.zeros((3, 3)), np.full((3, 3), np.nan), np.diag([np.inf, 1.0, 1.0])])
def test_a_mesh_without_area_is_refused(vertices: np.ndarray) -> None:
    with pytest.raises(ValueError, match="positive, finite area"):
        sample_surface(vertices, np.array([[0, 1, 2]]), 10, np.random.default_rng(0))


def test_the_same_stream_gives_the_same_points_and_another_gives_others() -> None:
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    one, again, other = (sample_surface(TRIANGLE, faces, 64, np.random.default_rng(seed))[0] for seed in (5, 5, 6))
    assert one.tobytes() == again.tobytes() != other.tobytes()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), parts=st.integers(1, 9))
def test_every_point_lies_on_the_part_that_its_labels_name(seed: int, parts: int) -> None:
    rng = np.random.default_rng(seed)
    types = [part_type(f"soup{count}", *soup(rng, count)) for count in (1, 4, 7)]
    poses = np.stack([rotation(rng) for _ in range(parts)])
    assembly = Assembly(rng.integers(0, 3, parts).astype(np.int16), poses, np.empty((0, 2), dtype=np.int32))
    cloud = sample_shape(Shape(tuple(types), assembly, "y", tuple(kind.name for kind in types)), 200, rng)
    assert cloud.labels.dtype == cloud.instances.dtype == np.int16
    assert (cloud.labels == assembly.types[cloud.instances]).all()
    for instance in np.unique(cloud.instances):
        own = cloud.instances == instance
        part, pose = types[assembly.types[instance]], poses[instance]
        triangles = part.vertices[part.faces]
        local = transform_points(invert(pose), cloud.points.astype(np.float32)[own].astype(np.float64))
        distances = distance_to_triangles(transform_points(invert(pose), cloud.points[own]), triangles)
        assert distances.min(axis=1).max() < 1e-9
        assert np.abs(local - transform_points(invert(pose), cloud.points[own])).max() < 1e-6 * 20
        across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        across = across / np.linalg.norm(across, axis=1, keepdims=True) @ pose[:3, :3].T
        agrees = np.abs(across[None] - cloud.normals[own][:, None]).max(axis=2) < 1e-9
        assert (agrees & (distances < 1e-9)).any(axis=1).all()


def test_parts_of_an_assembly_are_hit_in_the_ratio_of_their_areas() -> None:
    small = part_type("small", TRIANGLE, np.array([[0, 1, 2]]))
    large = part_type("large", TRIANGLE * 2, np.array([[0, 1, 2], [0, 1, 1]]))
    assembly = Assembly(
        np.array([1, 0, 1], dtype=np.int16), np.stack([np.eye(4)] * 3), np.empty((0, 2), dtype=np.int32)
    )
    cloud = sample_shape(Shape((small, large), assembly, "y", ("small", "large")), 45_000, np.random.default_rng(4))
    for part, share in enumerate((4 / 9, 1 / 9, 4 / 9)):
        assert binomtest(int((cloud.instances == part).sum()), 45_000, share).pvalue > 1e-4


def test_table_of_several_meshes_holds_their_areas() -> None:
    two = surface_table([(TRIANGLE, np.array([[0, 0, 1], [0, 1, 2]])), (TRIANGLE * 2, np.array([[2, 1, 0]]))])
    assert two.area.tolist() == [4.0, 16.0]
    assert two.reach.tolist() == [0.0, 4.0, 16.0]


def test_a_mesh_without_faces_beside_others_is_refused() -> None:
    with pytest.raises(ValueError, match="positive, finite area"):
        surface_table([(TRIANGLE, np.array([[0, 1, 2]])), (TRIANGLE, np.empty((0, 3), dtype=np.int32))])
