"""Metrics of sets of shapes: hand-computed cases, and all pairs as an oracle of the candidates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.generated.set_comparison import COLUMNS, comparison_table
from eval.generated.set_metrics import (
    Neighbours,
    earth_movers_distance,
    jensen_shannon_divergence,
    nearest_by_chamfer,
    nearest_by_earth_movers,
    nearest_in_matrix,
    normalized_clouds,
    set_metrics,
    shape_descriptors,
)
from stages.shape.arrays import FloatArray
from stages.shape.geometry.clouds import chamfer_squared

LATTICE = np.stack(np.meshgrid(*(np.arange(4.0),) * 3), axis=-1).reshape(-1, 3)


def boxes(count: int, seed: int, low: float = 0.2) -> FloatArray:
    """Clouds of points in boxes of random proportions."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (count, 256, 3)) * rng.uniform(low, 1, (count, 1, 3))


def test_lattice_moved_by_less_than_half_a_step() -> None:
    shift = np.array([0.3, 0.0, 0.0])
    assert earth_movers_distance(LATTICE, LATTICE + shift) == pytest.approx(0.3)
    clouds = np.stack([LATTICE, LATTICE + 7]), np.stack([LATTICE + shift, LATTICE + 7 - shift])
    generated, reference, diversity = nearest_by_chamfer(*clouds)
    assert generated.other == pytest.approx([2 * 0.09] * 2)
    assert reference.other_index.tolist() == [0, 1]
    assert diversity == pytest.approx(chamfer_squared(LATTICE, LATTICE + 7))


def test_equal_separate_and_alternating_sets() -> None:
    def metrics(generated: list[float], reference: list[float]) -> tuple[float, float, float]:
        places = np.array([*generated, *reference])
        result = set_metrics(*nearest_in_matrix(np.abs(places[:, None] - places), len(generated)))
        return result.one_nna, result.coverage, result.matching_distance

    assert metrics([0, 1, 2, 4], [0, 1, 2, 4]) == (0.0, 100.0, 0.0), "each shape has its twin in the other set"
    assert metrics([0, 1, 2.5], [10, 11, 12.5]) == (100.0, pytest.approx(100 / 3), pytest.approx((7.5 + 8.5 + 10) / 3))
    assert metrics([0, 4, 8], [1, 5, 9]) == (0.0, 100.0, 1.0)
    assert metrics([0, 0.5, 0.6], [0.25, 9, 10])[1] == pytest.approx(100 / 3), "one mode of the reference is covered"


def test_ties_count_half() -> None:
    tied = Neighbours(np.ones(4), np.ones(4), np.arange(4, dtype=np.int32))
    assert set_metrics(tied, tied).one_nna == 50


@pytest.mark.parametrize("metric", ["chamfer", "earth movers"])
def test_candidates_are_those_of_all_pairs(metric: str) -> None:
    generated, reference = boxes(30, 1), boxes(30, 2)
    if metric == "chamfer":
        distance, found = chamfer_squared, nearest_by_chamfer(generated, reference)[:2]
    else:
        generated, reference = generated[:, :48], reference[:, :48]
        distance, found = earth_movers_distance, nearest_by_earth_movers(generated, reference)
    clouds = np.concatenate([generated, reference])
    every = np.array([[distance(first, second) for second in clouds] for first in clouds])
    for ours, exact in zip(found, nearest_in_matrix(every, 30), strict=True):
        assert ours.own == pytest.approx(exact.own)
        assert ours.other == pytest.approx(exact.other)
        assert np.array_equal(ours.other_index, exact.other_index)


def test_sets_of_one_distribution_cannot_be_distinguished_and_plates_can() -> None:
    same = set_metrics(*nearest_by_chamfer(boxes(40, 1), boxes(40, 2))[:2])
    other = set_metrics(*nearest_by_chamfer(boxes(40, 1) * [3, 3, 0.02], boxes(40, 2))[:2])
    assert 35 < same.one_nna < 65
    assert same.novelty < 20
    assert other.one_nna > 95
    assert other.novelty > 80


def test_divergence_of_places() -> None:
    left = np.zeros((1, 8, 3))
    right = left + np.array([1.0, 0, 0])
    assert jensen_shannon_divergence(left, left) == 0
    assert jensen_shannon_divergence(left, right) == pytest.approx(1)
    mixed = np.concatenate([left, right])
    entropy = -0.75 * np.log2(0.75) - 0.25 * np.log2(0.25)
    assert jensen_shannon_divergence(left, mixed) == pytest.approx(entropy - 0.5)


def test_normalized_clouds_do_not_depend_on_size_and_place() -> None:
    clouds = boxes(3, 5)
    moved = clouds * 7 + [1, 2, 3]
    assert normalized_clouds(moved) == pytest.approx(normalized_clouds(clouds))
    assert np.linalg.norm(normalized_clouds(moved), axis=2).max(axis=1) == pytest.approx(np.ones(3))
    assert shape_descriptors(normalized_clouds(moved)) == pytest.approx(shape_descriptors(normalized_clouds(clouds)))


def test_table_has_the_sets_and_two_halves_of_the_reference() -> None:
    table = comparison_table(("new", "old"), (boxes(9, 1), boxes(12, 2)), True, 16)
    assert [row[0] for row in table.rows] == ["new against old", "two halves of old"]
    assert [row[1] for row in table.rows] == [9, 6]
    assert all(len(row) == len(COLUMNS) for row in table.rows)


def test_sets_of_files(tmp_path: Path) -> None:
    from eval.generated.shape_sets import clouds_of_path
    from pipeline.errors import ConfigError

    np.save(tmp_path / "clouds.npy", boxes(5, 1))
    assert clouds_of_path(tmp_path / "clouds.npy", 4, 100).shape == (4, 100, 3)
    np.save(tmp_path / "flat.npy", np.zeros((5, 256, 2)))
    with pytest.raises(ConfigError, match=r"flat.npy has the shape \(5, 256, 2\)"):
        clouds_of_path(tmp_path / "flat.npy", 4, 100)
    with pytest.raises(ConfigError, match="nothing does not exist; name a folder of models"):
        clouds_of_path(tmp_path / "nothing", 4, 100)
    (tmp_path / "cloud.txt").touch()
    with pytest.raises(ConfigError, match=r"cloud.txt is no set of shapes"):
        clouds_of_path(tmp_path / "cloud.txt", 4, 100)
    (tmp_path / "one").mkdir()
    with pytest.raises(ConfigError, match="holds 0 shapes"):
        clouds_of_path(tmp_path / "one", 4, 100)


def test_folder_of_models(tmp_path: Path) -> None:
    import trimesh

    from eval.generated.shape_sets import clouds_of_path

    for name, extents in (("cube.obj", (2, 2, 2)), ("plate.ply", (2, 2, 0.2))):
        trimesh.creation.box(extents).export(tmp_path / name)
    clouds = clouds_of_path(tmp_path, 10, 500)
    assert sorted(np.ptp(clouds[..., 2], axis=1).round(1).tolist()) == [0.2, 2.0]
