from __future__ import annotations

import numpy as np
import pytest

from shipped_kits.outlines import arch, rectangle, regular
from shipped_kits.solids import Solid, bar, box, extruded, joined, loft, revolved, rotation, stacked, swept

RED, BLUE = (200, 30, 30), (30, 30, 200)


def volume(solid: Solid) -> float:
    vertices, faces, _ = solid.mesh()
    corners = vertices[faces]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def is_closed(solid: Solid) -> bool:
    """Return whether every directed edge meets exactly one in the other direction."""
    _, faces, _ = solid.mesh()
    edges = [tuple(edge) for face in faces.tolist() for edge in zip(face, face[1:] + face[:1], strict=True)]
    return len(set(edges)) == len(edges) and all((b, a) in set(edges) for a, b in edges)


def test_box_rests_on_its_position() -> None:
    solid = box((2.0, 3.0, 4.0), (1.0, 5.0, -1.0), RED)
    assert solid.points.min(axis=0) == pytest.approx([0.0, 5.0, -3.0])
    assert solid.points.max(axis=0) == pytest.approx([2.0, 8.0, 1.0])
    assert volume(solid) == pytest.approx(24.0)


@pytest.mark.parametrize(
    ("solid", "expected"),
    [
        (stacked(rectangle(2.0, 2.0), [(0.0, 0.0), (0.0, 1.0), (-0.5, 4.0)], RED), 4.0 + 7.0),
        (revolved([(1.0, 0.0), (0.0, 3.0)], 4, RED), 4.0),
        (revolved([(0.0, -3.0), (1.0, 0.0), (0.0, 3.0)], 4, RED), 8.0),
        (extruded(arch(2.0, 3.0, 1.0, 2), 0.0, 2.0, RED), 2 * (4.0 + 1.0)),
        (bar((0.0, 0.0, 0.0), (0.0, 2.0, 0.0), 0.5, RED, 4), 2.0),
        (bar((1.0, 0.0, 0.0), (-3.0, 0.0, 3.0), 0.5, RED, 4), 5.0),
    ],
)
def test_solids_are_closed_and_have_the_volume_of_what_they_are(solid: Solid, expected: float) -> None:
    assert is_closed(solid)
    assert volume(solid) == pytest.approx(expected, abs=1e-5)


def test_a_swept_bend_keeps_its_width() -> None:
    elbow = swept([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 0.0, 2.0)], rectangle(1.0, 1.0), RED)
    assert is_closed(elbow)
    assert volume(elbow) == pytest.approx(4.0, abs=1e-5)


def test_inset_removes_its_volume_and_boss_adds_it() -> None:
    block = box((2.0, 2.0, 2.0), (0.0, 0.0, 0.0), RED)
    pocket = block.inset((0.0, 1.0, 1.0), rectangle(1.0, 0.5), 0.5, BLUE)
    assert is_closed(pocket)
    assert volume(pocket) == pytest.approx(8.0 - 0.25)
    boss = block.inset((1.0, 1.0, 0.0), rectangle(1.0, 0.5), -0.5, BLUE, copies=4)
    assert is_closed(boss)
    assert volume(boss) == pytest.approx(8.0 + 4 * 0.25)
    assert boss.points.min(axis=0) == pytest.approx([-1.5, 0.0, -1.5])


def test_an_inset_may_lie_in_the_floor_of_another() -> None:
    solid = box((4.0, 4.0, 4.0), (0.0, 0.0, 0.0), RED).inset((0.0, 4.0, 0.0), rectangle(2.0, 2.0), 1.0, BLUE)
    deeper = solid.inset((0.0, 3.0, 0.0), rectangle(1.0, 1.0), 1.0, BLUE)
    assert is_closed(deeper)
    assert volume(deeper) == pytest.approx(64.0 - 4.0 - 1.0)


def test_inset_outside_the_solid_is_rejected() -> None:
    with pytest.raises(ValueError, match="no face"):
        box((2.0, 2.0, 2.0), (0.0, 0.0, 0.0), RED).inset((0.0, 1.0, 1.5), rectangle(1.0, 0.5), 0.5, BLUE)


def test_outline_is_upright_and_to_the_right_as_seen_from_outside() -> None:
    block = box((2.0, 2.0, 2.0), (0.0, 0.0, 0.0), RED)
    outline = np.array([(0.1, 0.2), (0.5, 0.2), (0.5, 0.3)])
    front = block.inset((0.0, 1.0, 1.0), outline, -0.25, BLUE).points[-3:]
    assert front == pytest.approx(np.array([(0.1, 1.2, 1.25), (0.5, 1.2, 1.25), (0.5, 1.3, 1.25)]))
    top = block.inset((0.0, 2.0, 0.0), outline, -0.25, BLUE).points[-3:]
    assert top == pytest.approx(np.array([(0.1, 2.25, -0.2), (0.5, 2.25, -0.2), (0.5, 2.25, -0.3)]))


def test_bands_have_their_colours_and_caps_that_of_their_band() -> None:
    _, faces, colors = revolved([(1.0, 0.0), (1.0, 1.0), (0.5, 2.0)], 4, [RED, BLUE]).mesh()
    assert len(faces) == len(colors) == 8 + 8 + 2 + 2
    assert sorted(map(tuple, colors.tolist())) == [BLUE] * 10 + [RED] * 10


def test_too_few_colours_are_rejected() -> None:
    with pytest.raises(ValueError, match="1 colours for 2 bands"):
        revolved([(1.0, 0.0), (1.0, 1.0), (0.5, 2.0)], 4, [RED])


def test_only_the_chosen_faces_are_tinted() -> None:
    solid = box((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), RED).tinted(BLUE, lambda _, corners: bool(corners[:, 1].min() > 0.5))
    assert [face.color for face in solid.faces].count(BLUE) == 1


def test_quarter_turns_are_exact_and_turn_to_the_left() -> None:
    assert (rotation(90.0, "y") @ [1.0, 0.0, 0.0]).tolist() == [0.0, 0.0, -1.0]
    assert (rotation(90.0, "x") @ [0.0, 1.0, 0.0]).tolist() == [0.0, 0.0, 1.0]
    assert (rotation(-90.0, "z") @ [0.0, 1.0, 0.0]).tolist() == [1.0, 0.0, 0.0]


def test_copies_around_the_axis_keep_every_shell_closed() -> None:
    post = revolved([(0.1, 0.0), (0.1, 1.0)], 6, RED).translated(2.0)
    ring = joined(post.around(6), loft([np.zeros((1, 3)), regular_ring(1.0), np.array([[0.0, 2.0, 0.0]])], BLUE))
    assert is_closed(ring)
    assert volume(ring) == pytest.approx(6 * volume(post) + 8 / 3, abs=1e-5)


def regular_ring(height: float) -> np.ndarray:
    plan = regular(4, 1.0)
    return np.column_stack([plan[:, 0], np.full(4, height), -plan[:, 1]])
