"""Show 1 of a grammar: of surfaces whose symmetries are known every shape is everywhere like the surface somewhere."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

from eval.grammars.similarity import SampledSurface, similarity_to, triangles_of
from stages.grammars.collisions import Collisions
from stages.grammars.derivation import Derivation, ResizedGrid
from stages.grammars.derivation_text import format_derivation
from stages.grammars.derived_shape import placed_terminals, shape_of_derivation_text, surface_digest
from stages.grammars.distinct_shapes import DerivationCollides, random_derivation, random_resized_grid
from stages.grammars.extraction.extract import ExtractedGrammar, SurfaceMesh, extract_grammar
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from tests.stages.symmetry.planted import (
    blind_corners,
    mesh,
    prongs_and_bridge,
    spiral_stair,
    uneven_wall,
    wall,
)

MAX_TESTED_SHAPES = 8


def extraction(triangles: FloatArray, radius: float) -> ExtractedGrammar:
    """Extract the grammar of grey triangles (f, 3, 3)."""
    vertices, faces = mesh(triangles)
    grey = np.full((len(faces), 3), 160, np.uint8)
    return extract_grammar(SurfaceMesh(vertices, faces, grey), "planted", radius, "z", np.random.default_rng(0))


def shapes_of(grammar: ShapeGrammar) -> list[FloatArray]:
    """Return different shapes by random productions and by grids in turn, as triangles (t, 3, 3)."""
    collisions = Collisions(grammar)
    texts: dict[str, str] = {}
    for seed in range(2 * MAX_TESTED_SHAPES):
        if len(texts) >= MAX_TESTED_SHAPES:
            break
        derivations: list[Derivation | ResizedGrid] = []
        with suppress(DerivationCollides):
            derivations.append(random_derivation(grammar, collisions, 5, np.random.default_rng(seed)))
        resized = random_resized_grid(grammar, 7, np.random.default_rng(seed))
        if not collisions.grid_collides(resized):
            derivations.append(resized)
        for derivation in derivations:
            digest = surface_digest(grammar, placed_terminals(grammar, derivation))
            texts.setdefault(digest, format_derivation(grammar, derivation))
    return [triangles_of(shape_of_derivation_text(grammar, text)) for text in list(texts.values())[:MAX_TESTED_SHAPES]]


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
    ids=["wall", "2-grid", "uneven wall", "interlocked pieces", "spiral stair", "rows that do not tile"],
)
def test_planted_sites_and_grids_are_found_and_every_shape_is_r_similar(
    triangles: FloatArray, radius: float, classes: int, grids: list[tuple[int, ...]]
) -> None:
    found = extraction(triangles, radius)
    assert found.site_classes == classes
    assert [grid.counts for grid in found.grammar.grids] == grids
    shapes = shapes_of(found.grammar)
    assert len(shapes) >= MAX_TESTED_SHAPES - 1
    exemplar = SampledSurface(triangles, found.grammar.radius, np.random.default_rng(0))
    for number, shape in enumerate(shapes):
        assert similarity_to(exemplar, shape, 60, np.random.default_rng(number)).share == 1.0


def test_rows_that_cross_differently_from_cell_to_cell_make_no_2_grid() -> None:
    """Symmetry figure 7b: bays and storeys are rows that overlap, by transforms that commute."""
    found = extraction(blind_corners(), 0.045)
    cells: dict[tuple[float, ...], list[set[int]]] = {}
    for row in found.rows:
        first, last = (found.docked_pieces[row.docked_pieces[end]].cells for end in (0, -1))
        along = tuple(np.abs(row.transform[:3, 3]).round(6).tolist())
        cells.setdefault(along, []).append(set(first.tolist()) - set(last.tolist()))
    assert set(cells) == {(1, 0, 0), (0, 0, 1)}
    assert all(bays & storeys for bays in cells[1, 0, 0] for storeys in cells[0, 0, 1])
    assert len(found.grammar.grids) == len(found.rows) == 4
    assert all(len(grid.counts) == 1 for grid in found.grammar.grids)
