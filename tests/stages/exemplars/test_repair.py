"""Repair of meshes: duplicates, solids that touch, orientation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.exemplars.read import read_parts
from stages.exemplars.repair import repair_mesh
from tests.stages.exemplars.model_files import BOX_FACES, box, signed_volume

EXEMPLARS = Path(__file__).resolve().parents[4] / "shared" / "exemplars"


def rainbow(faces: np.ndarray) -> np.ndarray:
    """Return a different colour for every face."""
    return np.column_stack([np.arange(len(faces)), np.full(len(faces), 7), np.full(len(faces), 9)]).astype(np.uint8)


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def edge_counts(faces: np.ndarray) -> np.ndarray:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0, return_counts=True)[1]


def half_edges_are_unique(faces: np.ndarray) -> bool:
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return len(np.unique(edges, axis=0)) == len(edges)


def triangle_sets(vertices: np.ndarray, faces: np.ndarray) -> set[tuple[tuple[float, ...], ...]]:
    return {tuple(sorted(map(tuple, triangle))) for triangle in vertices[faces].tolist()}


def test_sound_mesh_is_left_as_it_is() -> None:
    vertices, faces, sources, repair = repair_mesh(box(), BOX_FACES)
    assert repair.changes == {}
    np.testing.assert_array_equal(vertices[faces], box()[BOX_FACES])
    np.testing.assert_array_equal(sources, np.arange(12))
    assert (vertices.dtype, faces.dtype, sources.dtype) == (np.float64, np.int32, np.int64)


def test_vertices_at_one_place_become_one() -> None:
    soup = box()[BOX_FACES].reshape(-1, 3)
    vertices, faces, _, repair = repair_mesh(soup, np.arange(36, dtype=np.int32).reshape(-1, 3))
    assert repair.changes == {"merged_vertices": 28}
    assert len(vertices) == 8
    assert (edge_counts(faces) == 2).all()


def test_vertices_that_no_face_uses_go() -> None:
    vertices, faces, _, repair = repair_mesh(np.vstack([box(), [[9, 9, 9]]]), BOX_FACES)
    assert repair.changes == {"unreferenced_vertices": 1}
    assert len(vertices) == 8
    np.testing.assert_array_equal(vertices[faces], box()[BOX_FACES])


def test_face_that_stands_twice_or_reversed_goes_and_colours_stay_with_their_faces() -> None:
    faces = np.vstack([BOX_FACES, BOX_FACES[3][[1, 2, 0]], BOX_FACES[5][::-1]]).astype(np.int32)
    vertices, repaired, sources, repair = repair_mesh(box(), faces)
    assert repair.changes["duplicate_faces"] == 2
    assert len(repaired) == 12
    assert area(vertices, repaired) == pytest.approx(6)
    for triangle, color in zip(vertices[repaired], rainbow(faces)[sources], strict=True):
        assert triangle_sets(triangle, np.array([[0, 1, 2]])) == triangle_sets(box(), faces[color[0]][None])


def test_shell_that_was_exported_for_both_sides_becomes_one_shell() -> None:
    faces = np.vstack([BOX_FACES, BOX_FACES[:, ::-1]]).astype(np.int32)
    vertices, repaired, _, repair = repair_mesh(box(), faces)
    assert repair.changes["duplicate_faces"] == 12
    assert signed_volume(vertices, repaired) == pytest.approx(1)


def test_faces_without_area_go() -> None:
    vertices = np.vstack([box(), [[0.5, 0, 0], [0.25, 1e-9, 0]]])
    flat = np.array([[0, 8, 1], [0, 0, 1], [0, 9, 1]], dtype=np.int32)
    faces = np.vstack([BOX_FACES, flat])
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces)
    assert repair.changes["zero_area_faces"] == 3
    assert triangle_sets(repaired_vertices, repaired) == triangle_sets(box(), BOX_FACES)


def test_mesh_of_flat_faces_only_is_empty() -> None:
    line = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], dtype=np.float64)
    for faces in ([[0, 1, 2]], [[0, 0, 1]], [[1, 1, 1], [0, 2, 1]]):
        chosen = np.array(faces, dtype=np.int32)
        vertices, repaired, sources, repair = repair_mesh(line, chosen)
        assert (vertices.shape, repaired.shape, sources.shape) == ((0, 3), (0, 3), (0,))
        assert repair.changes["zero_area_faces"] == len(faces)


@pytest.mark.parametrize("welded", [False, True])
# the two sides of the wall between neighbours are split along one diagonal in z, along different ones in x
@pytest.mark.parametrize(("shift", "crowded"), [((1, 0, 0), 4), ((0, 0, 1), 5), ((1, 1, 0), 1), ((1, 1, 1), 0)])
def test_solids_that_touch_are_two_closed_solids(shift: tuple[int, int, int], crowded: int, welded: bool) -> None:
    vertices = np.vstack([box(), box(at=shift)])
    faces = np.vstack([BOX_FACES, BOX_FACES + 8]).astype(np.int32)
    if welded:
        vertices, place = np.unique(vertices, axis=0, return_inverse=True)
        faces = place.reshape(-1)[faces].astype(np.int32)
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces)
    assert repair.changes == ({"nonmanifold_edges": crowded} if welded and crowded else {})
    assert (edge_counts(repaired) == 2).all()
    assert signed_volume(repaired_vertices, repaired) == pytest.approx(2)
    assert triangle_sets(repaired_vertices, repaired) == triangle_sets(vertices, faces)


def test_sheets_that_cross_in_an_edge_are_cut_there_and_stay_in_place() -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], dtype=np.int32)
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces)
    assert repair.changes["nonmanifold_edges"] == 1
    assert edge_counts(repaired).max() <= 2
    assert triangle_sets(repaired_vertices, repaired) == triangle_sets(vertices, faces)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_turned_faces_of_a_closed_shell_face_outward_again(turned: list[bool]) -> None:
    faces = np.where(np.array(turned)[:, None], BOX_FACES[:, ::-1], BOX_FACES).astype(np.int32)
    vertices, repaired, sources, repair = repair_mesh(box(), faces)
    assert repair.changes.get("flipped_faces", 0) == sum(turned)
    assert half_edges_are_unique(repaired)
    assert signed_volume(vertices, repaired) == pytest.approx(1)
    np.testing.assert_array_equal(rainbow(faces)[sources], rainbow(faces))


def test_open_sheet_keeps_the_side_of_most_of_its_faces() -> None:
    count = 6
    vertices = np.array([[x, y, 0] for x in range(count) for y in (0, 1)], dtype=np.float64)
    faces = np.array(
        [face for k in range(count - 1) for face in ([2 * k, 2 * k + 2, 2 * k + 1], [2 * k + 1, 2 * k + 2, 2 * k + 3])]
    )
    faces[[0, 4, 5]] = faces[[0, 4, 5], ::-1]
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces.astype(np.int32))
    assert repair.changes == {"flipped_faces": 3}
    a, b, c = np.moveaxis(repaired_vertices[repaired], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize("inside_out", [False, True])
def test_cavity_goes_on_facing_inward(inside_out: bool) -> None:
    cavity = box((1, 1, 1), (1, 1, 1))
    vertices = np.vstack([box((3, 3, 3)), cavity])
    faces = np.vstack([BOX_FACES, BOX_FACES[:, ::-1] + 8]).astype(np.int32)
    given_faces = faces[:, ::-1] if inside_out else faces
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, np.ascontiguousarray(given_faces))
    assert signed_volume(repaired_vertices, repaired) == pytest.approx(27 - 1)
    assert repair.changes.get("flipped_faces", 0) == (24 if inside_out else 0)


def test_solid_inside_a_room_goes_on_facing_outward() -> None:
    vertices = np.vstack([box((3, 3, 3)), box((1, 1, 1), (1, 1, 1))])
    faces = np.vstack([BOX_FACES, BOX_FACES + 8]).astype(np.int32)
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces)
    assert repair.changes == {}
    assert signed_volume(repaired_vertices, repaired) == pytest.approx(28)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 11)] * 3), min_size=1, max_size=40))
def test_any_soup_keeps_its_surface_and_ends_manifold(rows: list[tuple[int, int, int]]) -> None:
    points = np.array([[x, y, z] for x in (0, 1, 2) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    faces = np.array(rows, dtype=np.int32)
    vertices, repaired, sources, _ = repair_mesh(points, faces)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    standing = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0
    assert triangle_sets(vertices, repaired) == triangle_sets(points, faces[standing])
    assert edge_counts(repaired).max(initial=0) <= 2
    for triangle, color in zip(vertices[repaired], rainbow(faces)[sources], strict=True):
        assert triangle_sets(triangle, np.array([[0, 1, 2]])) == triangle_sets(points, faces[color[0]][None])


def test_inside_out_solid_that_touches_another_faces_outward() -> None:
    vertices = np.vstack([box(), box(at=(1, 1, 0))])
    faces = np.vstack([BOX_FACES, BOX_FACES[:, ::-1] + 8]).astype(np.int32)
    repaired_vertices, repaired, _, repair = repair_mesh(vertices, faces)
    assert signed_volume(repaired_vertices, repaired) == pytest.approx(2)
    assert repair.changes["flipped_faces"] == 12


def test_repair_twice_is_repair_once() -> None:
    vertices = np.vstack([box(), box(at=(1, 1, 0)), box(at=(5, 0, 0))])
    faces = np.vstack([BOX_FACES, BOX_FACES[:, ::-1] + 8, BOX_FACES + 16, BOX_FACES[:2]]).astype(np.int32)
    once = repair_mesh(vertices, faces)
    twice = repair_mesh(*once[:2])
    for one, other in zip(once[:2], twice[:2], strict=True):
        np.testing.assert_array_equal(one, other)
    assert twice[3].changes == {}


@pytest.mark.skipif(not EXEMPLARS.is_dir(), reason="the real exemplars are not here")
def test_real_exemplars_keep_their_surfaces() -> None:
    for path in sorted(EXEMPLARS.glob("*/model.glb")):
        parts = {part.mesh_name: part for part in read_parts(path, "nodes").parts}
        for name, part in parts.items():
            vertices, faces, sources, _ = repair_mesh(part.vertices, part.faces)
            diagonal = np.linalg.norm(np.ptp(part.vertices, axis=0))
            np.testing.assert_allclose(vertices.min(axis=0), part.vertices.min(axis=0), atol=1e-6 * diagonal)
            np.testing.assert_allclose(vertices.max(axis=0), part.vertices.max(axis=0), atol=1e-6 * diagonal)
            assert edge_counts(faces).max() <= 2, (path, name)
            # what is gone stood twice, or has no area
            ids = np.unique(part.vertices, axis=0, return_inverse=True)[1].reshape(-1)
            _, first = np.unique(np.sort(ids[part.faces], axis=1), axis=0, return_index=True)
            missing = area(part.vertices, part.faces[first]) - area(vertices, faces)
            assert abs(missing) < 1e-6 * diagonal**2, (path, name)
            assert triangle_sets(vertices, faces) <= triangle_sets(part.vertices, part.faces), (path, name)
            assert len(sources) == len(faces)
