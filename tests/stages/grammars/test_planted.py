"""Show 1 of a grammar: of surfaces whose symmetries are known every shape is everywhere like the surface somewhere."""

from __future__ import annotations

import numpy as np
import pytest

from eval.grammars.similarity import r_similarity, triangles_of
from stages.grammars.collisions import Collisions
from stages.grammars.derivation_text import format_derivation, placed_terminals, shape_of_text, surface_digest
from stages.grammars.extraction.extract import ExtractedGrammar, SurfaceMesh, extract_grammar
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.random_derivations import DerivationCollides, random_derivation, random_resized_grid
from stages.shape.arrays import FloatArray
from tests.stages.symmetry.planted import (
    blind_corners,
    mesh,
    prongs_and_bridge,
    spiral_stair,
    uneven_wall,
    wall,
)

MOST = 8
"""So many shapes of a grammar are looked at."""


def extraction(triangles: FloatArray, radius: float) -> ExtractedGrammar:
    """The grammar of triangles (f, 3, 3) in grey."""
    vertices, faces = mesh(triangles)
    grey = np.full((len(faces), 3), 160, np.uint8)
    return extract_grammar(SurfaceMesh(vertices, faces, grey), "planted", radius, "z", np.random.default_rng(0))


def shapes_of(grammar: ShapeGrammar) -> list[FloatArray]:
    """Different shapes by random rules and by grids in turn, as triangles (t, 3, 3)."""
    collisions = Collisions(grammar)
    texts: dict[str, str] = {}
    for seed in range(2 * MOST):
        try:
            drawn = random_derivation(grammar, collisions, 5, np.random.default_rng(seed))
            texts.setdefault(
                surface_digest(grammar, placed_terminals(grammar, drawn)), format_derivation(grammar, drawn)
            )
        except DerivationCollides:
            pass
        counts = random_resized_grid(grammar, 7, np.random.default_rng(seed))
        if not collisions.whole(counts):
            texts.setdefault(
                surface_digest(grammar, placed_terminals(grammar, counts)), format_derivation(grammar, counts)
            )
    return [triangles_of(shape_of_text(grammar, each)) for each in list(texts.values())[:MOST]]


@pytest.mark.parametrize(
    ("triangles", "radius", "classes", "grids"),
    [
        (wall(4), 0.03, 1, [(3,)] * 2),
        (wall(4, 3), 0.03, 3, [(3, 2)] * 4),
        (uneven_wall(), 0.03, 16, [(2, 1)] * 3 + [(1, 1)] * 2),
        (prongs_and_bridge(), 0.02, 10, [(1,)] * 3),
        (spiral_stair(5), 0.03, 3, [(4,)] * 2),
        (blind_corners(), 0.045, 4, [(1,)] * 4),
    ],
    ids=["wall", "2-grid", "uneven wall", "interlocked dockers", "spiral stair", "rows that do not tile"],
)
def test_sites_and_grids_are_those_expected_and_every_shape_is_r_similar(
    triangles: FloatArray, radius: float, classes: int, grids: list[tuple[int, ...]]
) -> None:
    found = extraction(triangles, radius)
    assert len({each.site for each in found.docked_pieces}) == classes
    assert [each.counts for each in found.grammar.grids] == grids
    shapes = shapes_of(found.grammar)
    assert len(shapes) >= MOST - 1
    for shape in shapes:
        assert r_similarity(triangles, shape, found.grammar.radius, 60, np.random.default_rng(0)).share == 1.0


def test_rows_that_cross_otherwise_from_cell_to_cell_make_no_2_grid() -> None:
    """Symmetry figure 7b: bays and storeys are rows that overlap, by motions that commute."""
    found = extraction(blind_corners(), 0.045)
    cells: dict[tuple[float, ...], list[set[int]]] = {}
    for row in found.rows:
        first, last = (found.docked_pieces[row.docked_pieces[end]].cells for end in (0, -1))
        along = tuple(np.abs(row.transform[:3, 3]).round(6).tolist())
        cells.setdefault(along, []).append(set(first.tolist()) - set(last.tolist()))
    assert set(cells) == {(1, 0, 0), (0, 0, 1)}
    assert all(bays & storeys for bays in cells[1, 0, 0] for storeys in cells[0, 0, 1])
    assert len(found.grammar.grids) == len(found.rows) == 4
    assert all(len(each.counts) == 1 for each in found.grammar.grids)
