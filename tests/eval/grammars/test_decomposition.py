"""What comes back of known parts: everything where the cut is right, and nothing is made up where it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.grammars.decomposition import decomposition_table, merged, rand_index, returned
from stages.exemplars.read import read_model
from stages.shape.shape import Shape, kit_shape
from tests.toy_kits.chains_and_rings import box, kit_of, pose

MESHES = {"slab": box(2.0, 1.0, 2.0), "post": box(0.5, 1.0, 0.5)}
PILE = [("slab", pose(0, 0, 0)), ("post", pose(-0.5, 1, 0)), ("post", pose(0.5, 1, 0)), ("slab", pose(0, 2, 0))]
"""No corner of one part meets a corner of another, so its parts are pieces of their own when merged."""


@pytest.fixture(scope="module")
def pile() -> Shape:
    kit = kit_of(MESHES, [PILE])
    return kit_shape(kit, kit.exemplars[0].whole)


def test_all_comes_back_of_what_is_cut_right(pile: Shape) -> None:
    found = returned("pile", pile, "components")
    assert (found.parts, found.types, found.why) == ((4, 4), (2, 2), "")
    assert (found.part_index, found.type_index, found.back, found.contacts) == pytest.approx((1.0, 1.0, 1.0, 1.0))


def test_what_cannot_be_cut_has_a_reason_and_no_figures(pile: Shape) -> None:
    found = returned("pile", pile, "materials")
    assert found.parts == (4, 0)
    assert found.why
    (row,) = decomposition_table([("pile", pile)], ["materials"]).rows
    assert row[2:8] == ("4 / 0", "2 / 0", "", "", "", "")


def test_a_merged_model_is_one_mesh_of_the_same_surface(pile: Shape, tmp_path: Path) -> None:
    merged(pile, tmp_path / "pile.glb")
    model = read_model(tmp_path / "pile.glb", "nodes")
    (part,) = model.parts
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), (2.0, 3.0, 2.0), atol=1e-6)
    assert len(part.faces) == 4 * 12


def test_the_rand_index_is_that_of_hubert_and_arabie() -> None:
    assert rand_index(np.array([0, 0, 1, 1]), np.array([5, 5, 2, 2])) == 1.0
    assert rand_index(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])) == pytest.approx(-0.5)
    assert rand_index(np.array([0, 0, 1, 2]), np.array([0, 0, 1, 1])) == pytest.approx(4 / 7)
    assert rand_index(np.zeros(4), np.zeros(4)) == 1.0
