from __future__ import annotations

import numpy as np
import pytest

from eval.grammars.similarity import r_similarity
from stages.grammars.extraction.docked_pieces import find_docked_pieces
from stages.grammars.extraction.productions import seams_by_site
from stages.grammars.extraction.seams import cut_out
from stages.symmetry.surface.grid import surface_grid
from stages.symmetry.surface.soup import Soup
from tests.stages.symmetry.planted import area, moved, prongs_and_bridge, shift


def test_interlocked_pieces_are_exchanged_as_one() -> None:
    """Symmetry figure 5d: two prongs replace the bridge, and the bridge replaces them.

    The bar of the bridge has four sides of 3 by 1 and covers two of 1 by 1.
    """
    triangles = prongs_and_bridge()
    grid = surface_grid(triangles, 0.02)
    pieces = find_docked_pieces(grid, shift(9, 0, 0)[None])
    seams = seams_by_site(grid, pieces)
    whole = Soup(grid.corners, grid.faces)
    z = grid.origin[2] + grid.cell_size * grid.cells[:, 2]
    prongs, bridge = (piece for piece in pieces if z[piece.cells].min() > 1)
    assert prongs.site == bridge.site
    for old, new, more in ((prongs, bridge, 10.0), (bridge, prongs, -10.0)):
        _, stays = cut_out(whole, grid, old.cells, old.frame, seams[old.site])
        comes, _ = cut_out(whole, grid, new.cells, new.frame, seams[new.site])
        shape = np.concatenate([stays.corners, moved(comes.corners, old.frame @ np.linalg.inv(new.frame))])
        assert area(shape) == pytest.approx(area(triangles) + more, rel=1e-9)
        assert r_similarity(triangles, shape, grid.radius, 60, np.random.default_rng(0)).share == 1.0


def test_pieces_on_two_sides_of_a_bar_have_sites_of_two_classes() -> None:
    """Where the bar is equal on both sides of a site, its left end lies near the right end of another."""
    grid = surface_grid(prongs_and_bridge(), 0.02)
    across = grid.origin[0] + grid.cell_size * (grid.cells[:, 0] + 0.5)
    sides: dict[int, set[bool]] = {}
    for piece in find_docked_pieces(grid, np.array([shift(9, 0, 0), shift(15, 0, 0), shift(4, 0, 0)])):
        if np.ptp(across[piece.border]) < 2 * grid.cell_size:
            rightward = bool(across[piece.cells].mean() > across[piece.border].mean())
            sides.setdefault(piece.site, set()).add(rightward)
    assert {True} in sides.values()
    assert {False} in sides.values()
    assert {True, False} not in sides.values()
