"""Exchanges by known parts, and their recall by the grammar."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from eval.grammars.exchanges import known_exchanges
from eval.grammars.grammar_recall import grammar_table, measure_recall
from stages.shape.kit import Kit
from tests.stages.symmetry.planted import mesh, wall
from tests.toy_kits.chains_and_rings import box, kit_of, pose


def prism(*outline: tuple[float, float], height: float) -> Any:
    """Return a prism around the y axis over a convex outline (x, z), centred in y."""
    points = [(x, y * height, z) for y in (-0.5, 0.5) for x, z in outline]
    return trimesh.convex.convex_hull(np.array(points))


MESHES = {
    "slab": prism((-3.0, -1.5), (2.0, -1.8), (3.0, 1.5), (-2.0, 1.8), height=0.5),
    "pedestal": prism((-0.9, -0.7), (0.8, -0.5), (0.4, 0.6), (-0.6, 0.4), height=2.0),
    "tower": prism((-1.2, -1.0), (1.1, -0.8), (1.3, 0.7), (-0.9, 1.2), height=4.0),
    "wedge": prism((-1.2, -0.9), (1.3, -1.0), (0.2, 1.3), height=2.5),
}
MONUMENT = [
    ("slab", pose(0, 0, 0)),
    ("pedestal", pose(-1.5, 1.25, 0)),
    ("pedestal", pose(1.5, 1.25, 0, 2)),
    ("tower", pose(-1.5, 4.25, 0)),
    ("wedge", pose(1.5, 3.5, 0, 2)),
]
"""Two pedestals, one the other turned by half a turn, with different parts on top."""


@pytest.fixture(scope="module")
def monument() -> Kit:
    return kit_of(MESHES, [MONUMENT])


def test_parts_on_equal_pedestals_are_the_only_exchange(monument: Kit) -> None:
    (found,) = known_exchanges(monument)
    assert sorted([np.flatnonzero(found.removed).tolist(), np.flatnonzero(found.piece).tolist()]) == [[3], [4]]


def test_grammar_of_merged_monument_has_exactly_the_known_exchange(monument: Kit) -> None:
    found = measure_recall("monument", monument)
    assert (found.known, found.found) == (1, 1)
    assert found.pairs == found.whole == 1


def test_exchange_on_plates_is_not_found() -> None:
    """A docking site in a plane could be anywhere on it, so it is left out."""
    more = {
        "plate": prism((-1.4, -1.1), (1.2, -0.8), (0.6, 1.0), (-0.9, 0.6), height=0.5),
        "mast": prism((-0.4, -0.3), (0.5, -0.2), (0.1, 0.4), height=4.0),
        "post": prism((-0.3, -0.4), (0.4, -0.4), (0.3, 0.4), (-0.2, 0.2), height=2.0),
    }
    row = [("plate", pose(-1.5, 0.5, 0)), ("plate", pose(1.5, 0.5, 0, 2))]
    row += [("mast", pose(-1.5, 2.75, 0)), ("post", pose(1.5, 1.75, 0, 2))]
    kit = kit_of(MESHES | more, [[MONUMENT[0], *row]])
    found = measure_recall("plates", kit)
    assert (found.known, found.found, found.pairs) == (1, 0, 0)
    (cells,) = grammar_table([("plates", kit)]).rows
    assert cells[2:7] == (1, 0.0, "0 / 0", 0, "")


def test_bays_of_a_single_part_wall_are_not_whole_parts() -> None:
    triangles = wall(3)[:, ::-1][:, :, [0, 2, 1]]  # y up
    vertices, faces = mesh(triangles)
    parts = {"wall": trimesh.Trimesh(vertices, faces, process=False), "plinth": box(5.0, 0.2, 0.5)}
    found = measure_recall("wall", kit_of(parts, [[("plinth", pose(2.1, -0.1, 0.15)), ("wall", pose(0, 0, 0))]]))
    assert found.known == 0
    assert found.pairs > 0
    assert found.whole == 0
