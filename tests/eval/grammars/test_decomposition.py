"""Recovery of known parts from merged models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.grammars.decomposition import decomposition_table, measure_part_recovery, rand_index, write_merged
from stages.exemplars.read import read_parts
from stages.shape.shape import Shape, kit_shape
from tests.toy_kits.chains_and_rings import box, kit_of, pose

MESHES = {"slab": box(2.0, 1.0, 2.0), "post": box(0.5, 1.0, 0.5)}
PILE = [("slab", pose(0, 0, 0)), ("post", pose(-0.5, 1, 0)), ("post", pose(0.5, 1, 0)), ("slab", pose(0, 2, 0))]
"""No vertices of two parts coincide, so parts stay separate components when merged."""


@pytest.fixture(scope="module")
def pile() -> Shape:
    kit = kit_of(MESHES, [PILE])
    return kit_shape(kit, kit.exemplars[0].whole)


def test_right_segmentation_recovers_all_parts(pile: Shape) -> None:
    found = measure_part_recovery("pile", pile, "components")
    assert (found.parts, found.types, found.failure) == ((4, 4), (2, 2), "")
    assert (found.part_index, found.type_index, found.recovered, found.contacts) == pytest.approx((1.0, 1.0, 1.0, 1.0))


def test_failed_segmentation_has_a_reason_and_no_values(pile: Shape) -> None:
    found = measure_part_recovery("pile", pile, "materials")
    assert found.parts == (4, 0)
    assert found.failure
    (row,) = decomposition_table([("pile", pile)], ["materials"]).rows
    assert row[2:8] == ("4 / 0", "2 / 0", "", "", "", "")


def test_merged_model_is_one_mesh_of_the_same_surface(pile: Shape, tmp_path: Path) -> None:
    write_merged(pile, tmp_path / "pile.glb")
    model = read_parts(tmp_path / "pile.glb", "nodes")
    (part,) = model.parts
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), (2.0, 3.0, 2.0), atol=1e-6)
    assert len(part.faces) == 4 * 12


def test_rand_index_agrees_with_hubert_and_arabie() -> None:
    assert rand_index(np.array([0, 0, 1, 1]), np.array([5, 5, 2, 2])) == 1.0
    assert rand_index(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])) == pytest.approx(-0.5)
    assert rand_index(np.array([0, 0, 1, 2]), np.array([0, 0, 1, 1])) == pytest.approx(4 / 7)
    assert rand_index(np.zeros(4), np.zeros(4)) == 1.0
