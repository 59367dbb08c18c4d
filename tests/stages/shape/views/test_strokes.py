from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.scene import MeshSet, Scene, mesh_scene
from stages.shape.views.strokes import BOUNDARY_LINE, CONTOUR_LINE, CREASE_LINE, OUTLINE_LINE, find_strokes
from tests.stages.shape.views.solids import BOX_CORNERS, BOX_EDGES, box, boxes_scene, cylinder

IMAGE_PIXELS = 256
CORNER = Camera(30.0, 25.0)
UP = np.array([0.0, 1.0, 0.0])


def strokes_of(scene, camera, crease_angle=35.0, step=0.5, shortest=6.0):
    return find_strokes(
        visible_triangles(scene, camera, (IMAGE_PIXELS, IMAGE_PIXELS), "raster"), crease_angle, step, shortest
    )


def lengths(strokes):
    return np.linalg.norm(strokes.ends[:, 1] - strokes.ends[:, 0], axis=1)


def on_screen(view, points):
    eye = points @ view.eye[:3, :3].T + view.eye[:3, 3]
    out = np.column_stack([eye, np.ones(len(eye))]) @ view.projection.T
    x, y = out[:, 0] / out[:, 3], out[:, 1] / out[:, 3]
    return np.stack([(x + 1) / 2 * IMAGE_PIXELS, (1 - y) / 2 * IMAGE_PIXELS], axis=1)


def segment_distances(points, starts, ends):
    """Distance of each point (n, 2) from the nearest of the segments."""
    way = ends - starts
    along = np.einsum("nsk,sk->ns", points[:, None] - starts, way) / np.maximum((way**2).sum(axis=1), 1e-12)
    nearest = starts + np.clip(along, 0, 1)[..., None] * way
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def test_a_box_from_a_corner_has_its_nine_visible_edges_and_nothing_else():
    scene = boxes_scene([(0, 0, 0)])
    strokes = strokes_of(scene, CORNER)
    screen = on_screen(CORNER.look(scene.points, "y"), BOX_CORNERS)
    hidden = np.argmin(BOX_CORNERS @ CORNER.look(scene.points, "y").eye[2, :3])
    visible = [(i, j) for i, j in BOX_EDGES if hidden not in (i, j)]
    assert len(visible) == 9
    starts, ends = (screen[[edge[k] for edge in visible]] for k in (0, 1))
    assert segment_distances(strokes.ends.reshape(-1, 2), starts, ends).max() < 0.75
    total = np.linalg.norm(ends - starts, axis=1).sum()
    assert lengths(strokes).sum() == pytest.approx(total, rel=0.01)
    inner = [k for k, edge in enumerate(visible) if np.argmax(BOX_CORNERS @ [0.5, 0.42, 0.8]) in edge]
    creased = np.linalg.norm((ends - starts)[inner], axis=1).sum()
    assert lengths(strokes)[strokes.kinds == CREASE_LINE].sum() == pytest.approx(creased, rel=0.03)
    assert set(strokes.kinds.tolist()) == {CREASE_LINE, OUTLINE_LINE}


def test_lines_are_straight_to_a_tenth_of_a_pixel():
    scene = boxes_scene([(0, 0, 0)])
    strokes = strokes_of(scene, CORNER)
    screen = on_screen(CORNER.look(scene.points, "y"), BOX_CORNERS)
    starts, ends = (screen[[edge[k] for edge in BOX_EDGES]] for k in (0, 1))
    points = strokes.ends.reshape(-1, 2)
    far_from_corners = np.linalg.norm(points[:, None] - screen[None], axis=2).min(axis=1) > 2.0
    assert segment_distances(points[far_from_corners], starts, ends).max() < 0.1


def test_a_cylinder_of_64_sides_has_two_circles_and_two_side_lines():
    vertices, faces = cylinder(64)
    scene = mesh_scene(vertices, faces, np.zeros((len(faces), 3), dtype=np.uint8), "y")
    camera = Camera(12.0, 30.0)
    strokes = strokes_of(scene, camera)
    view = camera.look(scene.points, "y")
    turn = np.linspace(0, 2 * np.pi, 721)
    circle = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    top, bottom = on_screen(view, circle + UP), on_screen(view, circle - UP)
    sides = [np.stack([top[k], bottom[k]]) for k in (top[:, 0].argmin(), top[:, 0].argmax())]
    starts = np.concatenate([top[:-1], bottom[:-1], [side[0] for side in sides]])
    ends = np.concatenate([top[1:], bottom[1:], [side[1] for side in sides]])
    assert segment_distances(strokes.ends.reshape(-1, 2), starts, ends).max() < 1.5
    middle = IMAGE_PIXELS / 2
    crossing = (strokes.ends[:, :, 1].min(axis=1) < middle) & (strokes.ends[:, :, 1].max(axis=1) >= middle)
    assert len(np.unique(np.round(strokes.ends[crossing, 0, 0] / 3))) == 2


def test_the_crease_angle_decides_whether_sides_are_drawn():
    vertices, faces = cylinder(12)
    scene = mesh_scene(vertices, faces, np.zeros((len(faces), 3), dtype=np.uint8), "y")
    sharp, smooth = (strokes_of(scene, Camera(0.0, 20.0), crease_angle=angle) for angle in (25.0, 35.0))
    inner = lengths(sharp)[sharp.kinds == CREASE_LINE].sum() - lengths(smooth)[smooth.kinds == CREASE_LINE].sum()
    side = np.ptp(on_screen(Camera(0.0, 20.0).look(scene.points, "y"), np.array([[0, 1.0, 1], [0, -1, 1]]))[:, 1])
    assert inner > 4 * side


def test_two_boxes_side_by_side_differ_from_one_long_box_by_their_seam():
    long = strokes_of(boxes_scene([(0.5, 0, 0)], [(2, 1, 1)]), CORNER)
    two = strokes_of(boxes_scene([(0, 0, 0), (1, 0, 0)], edges=[(0, 1)]), CORNER)
    assert BOUNDARY_LINE not in long.kinds
    seam = lengths(two)[two.kinds == BOUNDARY_LINE].sum()
    assert lengths(two).sum() - lengths(long).sum() == pytest.approx(seam, abs=3.0)
    view = CORNER.look(boxes_scene([(0.5, 0, 0)], [(2, 1, 1)]).points, "y")
    ring = on_screen(view, np.array([[0.5, -0.5, 0.5], [0.5, 0.5, 0.5], [0.5, 0.5, -0.5]]))
    assert seam == pytest.approx(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum(), rel=0.03)


def test_pieces_of_one_surface_have_no_line_where_it_goes_on_and_a_crease_where_they_meet_at_an_angle():
    vertices, faces = box()
    half = faces[~(vertices[faces][:, :, 0] == 0.5).all(axis=1)]
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    turned[0, 3] = 1.0
    mesh, twice = MeshSet.of([(vertices, half, np.full((len(half), 3), 128))]), np.zeros(2, dtype=np.int32)
    one = Scene(mesh, twice, np.array([np.eye(4), turned]), twice, "y", one_surface=True)
    long = strokes_of(boxes_scene([(0.5, 0, 0)], [(2, 1, 1)]), CORNER)
    assert BOUNDARY_LINE in strokes_of(replace(one, one_surface=False), CORNER).kinds
    assert lengths(strokes_of(one, CORNER)).sum() == pytest.approx(lengths(long).sum(), abs=3.0)
    scene = boxes_scene([(0, 0, 0), (0, 0.45, 0)], [(1, 1, 1), (0.5, 1, 0.5)])
    met, creased = strokes_of(scene, CORNER), strokes_of(replace(scene, one_surface=True), CORNER)
    assert BOUNDARY_LINE in met.kinds
    assert BOUNDARY_LINE not in creased.kinds
    assert lengths(creased).sum() == pytest.approx(lengths(met).sum(), rel=0.01)


def test_line_of_intersecting_boxes_lies_where_they_meet():
    scene = boxes_scene([(0, 0, 0), (0, 0.45, 0)], [(1, 1, 1), (0.5, 1, 0.5)])
    strokes = strokes_of(scene, CORNER)
    view = CORNER.look(scene.points, "y")
    square = np.array([[x, 0.5, z] for x, z in ((-0.25, 0.25), (0.25, 0.25), (0.25, -0.25))])
    ring = on_screen(view, square)
    meeting = strokes.ends[strokes.kinds == BOUNDARY_LINE].reshape(-1, 2)
    assert segment_distances(meeting, ring[:-1], ring[1:]).max() < 1.0
    total = np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()
    assert lengths(strokes)[strokes.kinds == BOUNDARY_LINE].sum() == pytest.approx(total, rel=0.05)


def test_a_box_behind_another_leaves_no_line_on_it():
    front = boxes_scene([(0, 0, 2), (0.3, 0.2, -2)], [(1.5, 1.5, 0.2), (1, 1, 1)])
    camera = Camera(0.0, 0.0)
    strokes = strokes_of(front, camera)
    view = camera.look(front.points, "y")
    face = on_screen(view, np.array([[-0.75, -0.75, 2.1], [0.75, 0.75, 2.1]]))
    middles = strokes.ends.mean(axis=1)
    low, high = face.min(axis=0) + 1.5, face.max(axis=0) - 1.5
    assert not ((middles > low) & (middles < high)).all(axis=1).any()


def test_an_overlapping_box_in_front_is_a_contour_and_the_background_an_outline():
    scene = boxes_scene([(0, 0, 0), (0, 0, 2)], [(3, 3, 0.2), (1, 1, 0.2)])
    strokes = strokes_of(scene, Camera(0.0, 0.0))
    assert set(strokes.kinds.tolist()) == {CONTOUR_LINE, OUTLINE_LINE}


def test_specks_are_left_out_and_a_limit_of_zero_keeps_them():
    scene = boxes_scene([(0, 0, 0), (0, 0, 1)], [(1, 1, 1), (0.006, 0.006, 0.006)])
    camera = Camera(0.0, 0.0)
    clean, all_lines = (strokes_of(scene, camera, shortest=limit) for limit in (8.0, 0.0))
    middle = np.abs(all_lines.ends.mean(axis=1) - IMAGE_PIXELS / 2).max(axis=1) < 10
    assert middle.any()
    assert lengths(all_lines).sum() - lengths(clean).sum() == pytest.approx(lengths(all_lines)[middle].sum())


def seen_edge_points(places, sizes, eye):
    """Points on the edges of boxes, and which of them are seen from `eye`: by rays against boxes, pixel-free."""
    share = (np.arange(60) + 0.5)[:, None] / 60
    points = np.concatenate(
        [
            (BOX_CORNERS[i] * (1 - share) + BOX_CORNERS[j] * share) * size + place
            for place, size in zip(places, sizes, strict=True)
            for i, j in BOX_EDGES
        ]
    )
    way = points - eye
    seen = np.ones(len(points), dtype=bool)
    with np.errstate(divide="ignore"):
        for place, size in zip(places, sizes, strict=True):
            half = np.asarray(size) / 2 * (1 - 1e-6)
            first, second = (place - half - eye) / way, (place + half - eye) / way
            enter = np.minimum(first, second).max(axis=1)
            leave = np.maximum(first, second).min(axis=1)
            seen &= ~((enter < leave) & (enter < 1 - 1e-6) & (leave > 0))
    return points, seen


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 100_000), st.floats(-180, 180), st.floats(-60, 80))
def test_every_stroke_is_a_visible_edge_and_every_visible_edge_a_stroke(seed, azimuth, elevation):
    rng = np.random.default_rng(seed)
    cells = rng.permutation(27)[: rng.integers(2, 9)]
    places = np.stack([cells // 9, cells // 3 % 3, cells % 3], axis=1) * 1.0
    sizes = rng.uniform(0.25, 0.85, (len(cells), 3))
    scene = boxes_scene(places, sizes)
    camera = Camera(azimuth, elevation, fov=35.0)
    strokes = strokes_of(scene, camera)
    view = camera.look(scene.points, "y")
    eye = -view.eye[:3, :3].T @ view.eye[:3, 3]
    points, seen = seen_edge_points(places, sizes, eye)
    edges = on_screen(view, points[seen])
    middles = strokes.ends.mean(axis=1)
    # Sampled edges are less than two pixels apart; a stroke may lie half of that and one pixel more away.
    assert segment_distances(middles, edges, edges).max() < 2.0
    drawn = segment_distances(edges, strokes.ends[:, 0], strokes.ends[:, 1]) < 1.5
    assert drawn.mean() > 0.97
