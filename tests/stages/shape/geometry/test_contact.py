from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stages.shape.arrays import FloatArray
from stages.shape.geometry import contact
from stages.shape.geometry.contact import (
    ContactTest,
    overlapping_boxes,
    world_boxes,
)
from stages.shape.geometry.mesh_pairs import first_pairs, near_pairs
from stages.shape.geometry.pose import invert
from stages.shape.kit import ContactKind
from tests.stages.shape.geometry.bodies import (
    Body,
    box,
    fcl_gap,
    hull,
    joined,
    part,
    placed,
    prism,
    random_rotation,
    sheet,
    sphere,
)

CONTACT_TOLERANCE = 1e-3
"""Of bodies about one unit large."""


def turned(axis: str, degrees: float) -> FloatArray:
    matrix: FloatArray = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    return matrix


def kind_of(one: Body, other: Body, pose: FloatArray, tolerance: float = CONTACT_TOLERANCE) -> ContactKind | None:
    """The kind of contact; the same whichever part asks, and however the meshes stand in their own coordinates."""
    kind = ContactTest([part(one), part(other)], tolerance).kind(0, 1, pose)
    assert ContactTest([part(one), part(other)], tolerance).kind(1, 0, invert(pose)) == kind
    rng = np.random.default_rng(1)
    for _ in range(4):
        first, second = placed(rotation=random_rotation(rng)), placed(rotation=random_rotation(rng))
        meshes = [(v @ m[:3, :3].T, f) for (v, f), m in ((one, first), (other, second))]
        found = ContactTest([part(mesh) for mesh in meshes], tolerance).kind(0, 1, first @ pose @ invert(second))
        assert found == kind, "the kind depends on the axes of the mesh"
    return kind


TURNS = {"upright": np.eye(3)} | {axis: turned(axis, 30.0) for axis in "xyz"}


def finely_divided(body: Body, times: int) -> Body:
    """The same surface in 4**times as many triangles."""
    vertices, faces = body
    for _ in range(times):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return vertices, faces


class TestDenseMeshes:
    """Of dense meshes only some pairs of triangles are looked at where these decide."""

    @pytest.mark.parametrize(
        ("pose", "kind"),
        [
            (placed(1, 0.1, 0.2), "face"),
            (placed(0.5, 0.3, 0.1), "line"),
            (placed(1, 0.997, 0), "line"),
            (placed(1, 0.999, 0.999), "point"),
            (placed(1.1, 0, 0), None),
        ],
    )
    def test_they_have_the_kind_that_all_pairs_give(
        self, pose: FloatArray, kind: ContactKind | None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """There are more pairs of near triangles than are looked at first."""
        tolerance, dense = 4e-3, part(finely_divided(box(), 7))
        test = ContactTest([dense], tolerance)
        pairs = near_pairs(dense.box_tree, dense.box_tree, pose, tolerance)
        first = first_pairs(dense.box_tree, dense.box_tree, pose, tolerance, 1000)
        np.testing.assert_array_equal(first, pairs[:1000])
        assert (len(pairs) > contact.PAIRS_LOOKED_AT[0]) == (kind in ("face", "line"))
        assert test.kind(0, 0, pose) == kind
        monkeypatch.setattr(contact, "PAIRS_LOOKED_AT", ())
        assert test.kind(0, 0, pose) == kind

    def test_some_pairs_of_a_wide_contact_decide(self) -> None:
        dense = part(finely_divided(box(), 7))
        points = ContactTest([dense], 4e-3).area(0, 0, placed(1, 0.1, 0.2))
        some = points[: len(points) // 8]
        length, width, _ = np.sort(np.ptp(some, axis=0))[::-1]
        assert contact.is_surely_wide(some, 0.5 * length, 0.5 * width)
        assert not contact.is_surely_wide(some, 0.5 * length, 1.5 * width)
        assert not contact.is_surely_wide(some, 2.0 * length, 0.5 * width)

    @pytest.mark.parametrize("count", [0, 1, 2])
    def test_fewer_than_three_points_are_not_surely_wide(self, count: int) -> None:
        assert not contact.is_surely_wide(np.eye(3)[:count], 0.0, 0.0)

    @given(st.integers(0, 2**32 - 1), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
    @settings(max_examples=200, deadline=None)
    def test_points_are_surely_wide_only_if_their_extents_are(self, seed: int, length: float, width: float) -> None:
        """Along any axes. length, width: as multiples of the largest and the second extent"""
        rng = np.random.default_rng(seed)
        every = rng.normal(size=(40, 3)) * np.sort(rng.exponential(size=3))
        some = every[rng.permutation(40)[:8]]
        extents = np.sort(np.ptp(every @ random_rotation(rng)[:3, :3], axis=0))
        if length > 1.0 or width > 1.0:
            assert not contact.is_surely_wide(some, length * extents[2], width * extents[1])


class TestBoxes:
    def test_they_meet_in_a_face(self) -> None:
        assert kind_of(box(), box(), placed(1, 0, 0)) == "face"
        assert kind_of(box(), box(), placed(1, 0.6, -0.7)) == "face"
        assert kind_of(box(), box(2, 3, 1), placed(0.3, 0.1, 1)) == "face"

    def test_they_meet_along_an_edge(self) -> None:
        assert kind_of(box(), box(), placed(1, 1, 0)) == "line"
        assert kind_of(box(), box(), placed(1, -1, 0.8)) == "line"

    def test_they_meet_in_a_corner(self) -> None:
        assert kind_of(box(), box(), placed(1, 1, 1)) == "point"
        assert kind_of(box(), box(), placed(-1, 1, 1)) == "point"

    def test_penetrating_meshes_are_in_contact(self) -> None:
        assert kind_of(box(), box(), placed(0.5, 0, 0)) == "face"
        assert kind_of(box(), box(), placed(0.5, 0.4, -0.3)) == "face"
        assert kind_of(box(), box(), placed(0.5, 0.4, 0.3, turned("xyz", (20, 40, 60)))) == "face"

    def test_they_are_apart(self) -> None:
        assert kind_of(box(), box(), placed(1 + 2 * CONTACT_TOLERANCE, 0, 0)) is None
        assert kind_of(box(), box(), placed(1 + 0.9 * CONTACT_TOLERANCE, 0, 0)) == "face"

    @pytest.mark.parametrize("axis", ["x", "y", "z"])
    def test_an_edge_stands_on_a_face_along_a_line_however_the_pair_is_turned(self, axis: str) -> None:
        up = {"x": (0, 1, 0), "y": (0, 0, 1), "z": (1, 0, 0)}[axis]
        reach = 0.5 + np.abs(turned(axis, 30.0).T @ up).sum() / 2
        assert kind_of(box(3, 3, 3), box(), placed(*(np.array(up) * (reach + 1.0)), turned(axis, 30.0))) == "line"

    def test_a_corner_stands_on_a_face_in_a_point(self) -> None:
        rotation = turned("xyz", (35, 25, 10))
        lowest = (box()[0] @ rotation.T)[:, 2].min()
        assert kind_of(box(4, 4, 1), box(), placed(0.2, 0.1, 0.5 - lowest, rotation)) == "point"

    def test_two_edges_cross_in_a_point(self) -> None:
        ridge, roof = turned("x", 45.0), turned("y", 45.0)
        above = np.sqrt(0.5)
        first = placed(rotation=ridge)
        second = placed(0, 0, 2 * above, roof)
        assert kind_of(box(), box(), invert(first) @ second) == "point"

    def test_a_beam_ends_on_the_side_of_another(self) -> None:
        assert kind_of(box(6, 1, 1), box(1, 4, 1), placed(0.7, 2.5, 0)) == "face"

    def test_one_inside_another_without_contact(self) -> None:
        assert kind_of(box(3, 3, 3), box(), np.eye(4)) is None

    def test_a_box_in_a_frame_touches_it_in_faces(self) -> None:
        frame = joined(box(1, 3, 1, (-1, 0, 0)), box(1, 3, 1, (1, 0, 0)), box(1, 1, 1, (0, 1, 0)))
        assert kind_of(frame, box(), np.eye(4)) == "face"

    def test_two_rows_of_corners_are_no_face(self) -> None:
        # A comb whose teeth end in edges: two parallel lines are as wide as a face and not a face.
        tooth = np.array([[0, 0, 0], [0, 1, 0], [-0.2, 0, 1], [-0.2, 1, 1], [0.2, 0, 1], [0.2, 1, 1]], dtype=float)
        faces = np.array([[0, 2, 4], [1, 5, 3], [0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1], [2, 3, 5], [2, 5, 4]])
        comb = joined((tooth, faces.astype(np.int32)), (tooth + np.array([0.8, 0, 0]), faces.astype(np.int32)))
        assert kind_of(box(4, 4, 1), comb, placed(0, 0, 0.5)) == "line"


class TestSheets:
    def test_meshes_that_lie_flat_are_in_face_contact(self) -> None:
        assert kind_of(sheet(), sheet(), placed(0.5, 0.25, 0)) == "face"
        assert kind_of(sheet(), sheet(), np.eye(4)) == "face"

    def test_they_go_on_in_one_plane(self) -> None:
        assert kind_of(sheet(), sheet(), placed(1, 0, 0)) == "line"

    def test_they_cross(self) -> None:
        assert kind_of(sheet(), sheet(), placed(rotation=turned("x", 90.0))) == "line"

    def test_one_stands_on_a_plate(self) -> None:
        assert kind_of(box(2, 2, 0.01), sheet(), placed(0, 0, 0.505, turned("x", 90.0))) == "line"

    def test_a_needle_pierces_one_in_a_point(self) -> None:
        assert kind_of(sheet(4, 4), prism(3, 0.01, 2.0), placed(0.3, 0.2, 0.1)) == "point"


class TestRound:
    def test_a_cylinder_lies_on_a_plate_along_a_line(self) -> None:
        lying = turned("y", 90.0)
        low = (prism(32)[0] @ lying.T)[:, 2].min()
        assert kind_of(box(6, 6, 1), prism(32), placed(0, 0, 0.5 - low, lying)) == "line"

    def test_a_cylinder_stands_on_a_plate_with_its_face(self) -> None:
        assert kind_of(box(6, 6, 1), prism(32), placed(0, 0, 2.0)) == "face"

    def test_a_ball_lies_on_a_plate_in_a_point(self) -> None:
        assert kind_of(box(6, 6, 1), sphere(), placed(0, 0, 1.5)) == "point"

    def test_a_peg_in_its_hole_touches_it_over_a_face(self) -> None:
        (inner, faces), (outer, _) = prism(24, 1.0, 2.0), prism(24, 1.5, 2.0)
        side = faces.reshape(24, 4, 3)[:, :2].reshape(-1, 3)
        tube = joined((inner, side), (outer, side))
        assert kind_of(tube, prism(24, 1.0, 3.0), np.eye(4)) == "face"
        assert kind_of(tube, prism(24, 0.9, 3.0), np.eye(4)) is None


BODIES = {
    "box": box(1.0, 0.6, 1.4),
    "L": joined(box(1, 1, 1), box(1, 1, 1, (1, 0, 0)), box(1, 1, 1, (0, 1, 0))),
    "cup": box(1, 1, 1, sides=5),
    "ball": sphere(10, 6),
    "rod": prism(7, 0.2, 3.0),
    "sheet": sheet(1.5, 0.7),
    "needle": box(0.01, 0.01, 2.0),
}


class TestAgainstFcl:
    @pytest.mark.parametrize("first", BODIES)
    @pytest.mark.parametrize("second", BODIES)
    def test_parts_touch_exactly_where_fcl_finds_them_within_tolerance(self, first: str, second: str) -> None:
        rng = np.random.default_rng(sum(map(ord, first + second)))
        tolerance = 0.05
        contact = ContactTest([part(BODIES[first]), part(BODIES[second])], tolerance)
        found = 0
        for shake in np.repeat([0.02, 0.1, 0.4], 20):
            near = BODIES[first][0][rng.integers(len(BODIES[first][0]))]
            rotation = random_rotation(rng)
            corner = rotation @ BODIES[second][0][rng.integers(len(BODIES[second][0]))]
            pose = placed(*(near - corner + rng.normal(size=3) * shake), rotation)
            gap = fcl_gap(BODIES[first], BODIES[second], pose)
            if abs(gap - tolerance) > 1e-6:
                assert contact.touches(0, 1, pose) == (gap <= tolerance), f"FCL says {gap}"
                assert contact.touches(1, 0, invert(pose)) == (gap <= tolerance)
                assert (contact.kind(0, 1, pose) is not None) == (gap <= tolerance)
                found += gap <= tolerance
        assert 0 < found < 60

    @settings(max_examples=60, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.floats(0.0, 3.5), st.sampled_from([1e-6, 1e-3, 0.1]))
    def test_random_hulls_touch_exactly_where_fcl_finds_them_within_tolerance(
        self, seed: int, distance: float, tolerance: float
    ) -> None:
        rng = np.random.default_rng(seed)
        one, other = hull(rng), hull(rng)
        direction = rng.normal(size=3)
        pose = placed(*(distance * direction / np.linalg.norm(direction)), random_rotation(rng))
        gap = fcl_gap(one, other, pose)
        if abs(gap - tolerance) > 1e-7:
            assert ContactTest([part(one), part(other)], tolerance).touches(0, 1, pose) == (gap <= tolerance)


class TestAssemblies:
    def test_contacts_are_those_of_all_pairs_in_order(self) -> None:
        rng = np.random.default_rng(5)
        contact = ContactTest([part(BODIES["L"]), part(BODIES["ball"])], 0.01)
        types = rng.integers(0, 2, 24).astype(np.int16)
        poses = np.array([placed(*rng.uniform(0, 6, 3), random_rotation(rng)) for _ in types])
        brute = [
            [i, j]
            for i in range(24)
            for j in range(i + 1, 24)
            if contact.touches(types[i], types[j], invert(poses[i]) @ poses[j])
        ]
        found = contact.contacts(types, poses)
        assert found.tolist() == brute
        assert len(brute) > 5
        assert found.dtype == np.int32

    def test_one_part_and_no_part_have_no_contacts(self) -> None:
        contact = ContactTest([part(box())], 0.01)
        assert contact.contacts(np.zeros(1, np.int16), np.eye(4)[None]).shape == (0, 2)

    def test_world_boxes_are_tight(self) -> None:
        poses = np.array([placed(5, 0, 0), placed(0, 0, 0, turned("z", 45.0))])
        boxes = world_boxes([part(box())], np.zeros(2, np.int16), poses)
        np.testing.assert_allclose(boxes[0], [[4.5, -0.5, -0.5], [5.5, 0.5, 0.5]])
        np.testing.assert_allclose(boxes[1], [[-(0.5**0.5), -(0.5**0.5), -0.5], [0.5**0.5, 0.5**0.5, 0.5]])

    @given(
        st.lists(st.tuples(*[st.integers(0, 6)] * 3, *[st.integers(0, 2)] * 3), max_size=14), st.sampled_from([0, 1])
    )
    def test_overlapping_boxes_are_those_of_all_pairs(self, corners: list[tuple[int, ...]], tolerance: int) -> None:
        # Whole numbers make ties: boxes that just touch overlap.
        values = np.array(corners, dtype=float).reshape(-1, 6)
        boxes = np.stack([values[:, :3], values[:, :3] + values[:, 3:]], axis=1)
        brute = [
            [i, j]
            for i in range(len(boxes))
            for j in range(i + 1, len(boxes))
            if (boxes[i, 0] <= boxes[j, 1] + tolerance).all() and (boxes[j, 0] <= boxes[i, 1] + tolerance).all()
        ]
        assert overlapping_boxes(boxes, float(tolerance)).tolist() == brute
