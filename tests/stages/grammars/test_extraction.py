from __future__ import annotations

import numpy as np

from stages.grammars.extraction.extract import SurfaceMesh, extract_grammar
from stages.shape.arrays import IntArray
from stages.shape.geometry.triangles import area_vectors
from tests.stages.symmetry.planted import mesh, wall


def facing(corners: np.ndarray) -> IntArray:
    """Return the axis along which triangles (f, 3, 3) face, int (f,)."""
    axes: IntArray = np.abs(area_vectors(corners)).argmax(axis=1).astype(np.int32)
    return axes


def test_terminals_keep_face_colours_without_triangles_of_no_area() -> None:
    vertices, faces = mesh(wall(3))
    colors = np.eye(3, dtype=np.uint8)[facing(vertices[faces])] * 200
    flat = np.zeros((5, 3), dtype=np.int32)
    found = extract_grammar(
        SurfaceMesh(vertices, np.concatenate([flat, faces]), np.concatenate([np.full((5, 3), 9, np.uint8), colors])),
        "wall", 0.05, "z", np.random.default_rng(0),
    )  # fmt: skip
    assert found.grammar.productions
    assert found.grammar.grids
    for part in (*found.grammar.meshes, found.grammar.exemplar):
        assert (part.face_colors.argmax(axis=1) == facing(part.vertices[part.faces])).all()
        assert (part.face_colors.max(axis=1) == 200).all()
