from __future__ import annotations

import numpy as np

from stages.grammars.extraction.extract import SurfaceMesh, extract_grammar
from stages.shape.arrays import IntArray
from tests.stages.symmetry.planted import mesh, wall


def facing(corners: np.ndarray) -> IntArray:
    """Along which axis triangles (f, 3, 3) face, int (f,)."""
    ways = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    found: IntArray = np.abs(ways).argmax(axis=1).astype(np.int32)
    return found


def test_terminals_have_the_colours_of_their_faces_where_others_without_area_are_left_out() -> None:
    vertices, faces = mesh(wall(3))
    colors = np.eye(3, dtype=np.uint8)[facing(vertices[faces])] * 200
    flat = np.zeros((5, 3), dtype=np.int32)
    found = extract_grammar(
        SurfaceMesh(vertices, np.concatenate([flat, faces]), np.concatenate([np.full((5, 3), 9, np.uint8), colors])),
        "wall", 0.05, "z", np.random.default_rng(0),
    )  # fmt: skip
    assert found.grammar.productions
    assert found.grammar.grids
    for each in (*found.grammar.meshes, found.grammar.exemplar):
        assert (each.face_colors.argmax(axis=1) == facing(each.vertices[each.faces])).all()
        assert (each.face_colors.max(axis=1) == 200).all()
