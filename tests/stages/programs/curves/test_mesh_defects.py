"""Every kind of defect is found and named."""

from __future__ import annotations

import numpy as np
import pytest

from stages.programs.curves import QuadMesh, box, mesh_defects

BOX = box((1, 1, 1))


def with_quads(quads: np.ndarray) -> QuadMesh:
    return QuadMesh(BOX.vertices, quads.astype(np.int32))


def test_box_has_no_defects() -> None:
    assert mesh_defects(BOX) == []


def test_missing_face_leaves_four_open_edges() -> None:
    assert mesh_defects(with_quads(BOX.quads[1:])) == ["4 edges are open"]


def test_reversed_face_is_found() -> None:
    turned = BOX.quads.copy()
    turned[0] = turned[0, ::-1]
    assert mesh_defects(with_quads(turned)) == ["4 edges lie between faces turned against each other"]


def test_box_inside_out_is_found() -> None:
    assert mesh_defects(with_quads(BOX.quads[:, ::-1])) == ["1 of 1 surfaces are inside out or enclose nothing"]


def test_box_inside_out_among_two_is_found() -> None:
    both = QuadMesh.joined([box((1, 1, 1), (9, 9, 9)), with_quads(BOX.quads[:, ::-1])])
    assert mesh_defects(both) == ["1 of 2 surfaces are inside out or enclose nothing"]


def test_double_face_is_found() -> None:
    defects = mesh_defects(with_quads(np.concatenate([BOX.quads, BOX.quads[:1]])))
    assert any("more than two faces" in defect for defect in defects)


def test_boxes_touching_in_a_vertex_are_found() -> None:
    second = box((1, 1, 1), (1, 1, 1))
    vertices = np.concatenate([BOX.vertices, second.vertices[1:]])
    quads = np.concatenate([BOX.quads, second.quads + 7]).astype(np.int32)
    assert BOX.vertices[7].tolist() == second.vertices[0].tolist()
    assert mesh_defects(QuadMesh(vertices, quads)) == ["surfaces touch in a vertex alone at 1 places"]


def test_flat_boxes_and_wrong_numbers_are_found() -> None:
    flat = QuadMesh(BOX.vertices * [1, 1, 0], BOX.quads)
    assert any("no area" in defect for defect in mesh_defects(flat))
    assert mesh_defects(QuadMesh(BOX.vertices[:7], BOX.quads)) == ["a face names a vertex outside 0 to 6"]
    assert mesh_defects(QuadMesh(BOX.vertices * np.nan, BOX.quads)) == ["a vertex is not finite"]
    assert mesh_defects(QuadMesh(BOX.vertices, BOX.quads[:0])) == ["the mesh has no faces"]


@pytest.mark.parametrize("shift", range(4))
def test_folded_quad_is_found(shift: int) -> None:
    crossed = BOX.quads.copy()
    crossed[0] = np.roll(crossed[0][[0, 2, 1, 3]], shift)
    assert any("folded" in defect for defect in mesh_defects(with_quads(crossed)))
