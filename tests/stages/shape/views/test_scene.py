from __future__ import annotations

import numpy as np

from stages.shape.kit import Assembly
from stages.shape.shape import kit_shape
from stages.shape.views.scene import MeshSet, mesh_scene, scene_of
from tests.stages.shape.views.solids import box, boxes_scene, cylinder, kit_of, part_type, posed


def test_every_edge_of_a_box_has_a_face_on_both_sides():
    vertices, faces = box()
    neighbours = MeshSet.of([(vertices, faces, np.zeros((12, 3), dtype=np.uint8))]).neighbours
    assert (neighbours >= 0).all()
    for face, row in enumerate(neighbours.tolist()):
        for edge, other in enumerate(row):
            ends = {faces[face, edge], faces[face, (edge + 1) % 3]}
            assert ends <= set(faces[other].tolist())


def test_a_seam_of_doubled_vertices_is_no_border():
    vertices, faces = cylinder(16)
    neighbours = MeshSet.of([(vertices, faces, np.zeros((len(faces), 3), dtype=np.uint8))]).neighbours
    assert (neighbours >= 0).all()


def test_an_edge_of_three_faces_has_no_single_neighbour():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], dtype=np.int32)
    assert (MeshSet.of([(vertices, faces, np.zeros((3, 3), dtype=np.uint8))]).neighbours == -1).all()


def test_equal_places_in_two_meshes_stay_apart():
    vertices, faces = box()
    colors = np.zeros((12, 3), dtype=np.uint8)
    neighbours = MeshSet.of([(vertices, faces, colors), (vertices, faces, colors)]).neighbours
    assert (neighbours[:12] < 12).all()
    assert (neighbours[12:] >= 12).all()


def test_scenes_of_one_kit_share_its_meshes():
    kit = kit_of(part_type("box", box()))
    one = Assembly(np.zeros(1, dtype=np.int16), posed((0, 0, 0)), np.empty((0, 2), dtype=np.int32))
    two = Assembly(np.zeros(2, dtype=np.int16), posed((0, 0, 0), (2, 0, 0)), np.empty((0, 2), dtype=np.int32))
    assert scene_of(kit_shape(kit, one)).meshes is scene_of(kit_shape(kit, two)).meshes
    other = kit_of(part_type("box", box()))
    assert scene_of(kit_shape(other, one)).meshes is not scene_of(kit_shape(kit, one)).meshes


def test_parts_that_touch_lie_in_different_layers():
    scene = boxes_scene([(k, 0, 0) for k in range(5)], edges=[(0, 1), (1, 2), (0, 2), (2, 3), (3, 4)])
    for i, j in ((0, 1), (1, 2), (0, 2), (2, 3), (3, 4)):
        assert scene.layers[i] != scene.layers[j]
    assert scene.layers.max() == 2


def test_world_points_are_the_posed_vertices():
    vertices, faces = box((1, 2, 3))
    scene = boxes_scene([(10, 0, 0), (0, 20, 0)], [(1, 2, 3), (1, 1, 1)])
    assert np.allclose(scene.points[:8], vertices + np.array([10, 0, 0]))
    assert np.allclose(scene.points[8:], box()[0] + np.array([0, 20, 0]))
    assert np.allclose(mesh_scene(vertices + 7, faces, np.zeros((12, 3), dtype=np.uint8), "y").points, vertices + 7)
