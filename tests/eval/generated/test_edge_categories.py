"""Accuracy of models of edge categories."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.engine.models import TrainedModel
from eval.generated.edge_categories import (
    CategoryScores,
    CategoryShares,
    categories_table,
    category_models,
    clusters_table,
    reconstruct_shape,
    score_model,
)
from eval.generated.pose_clusters import PoseClusters
from pipeline.errors import ConfigError
from stages.training.checkpoint import checkpoint_bytes
from tests.stages.training.edge_categories.networks import kit, network, random_model, trained_model, writer


@pytest.mark.slow
def test_trained_model_is_more_accurate_and_votes_close_more_often() -> None:
    shapes = [network(seed) for seed in range(6)]
    trained, random = (
        score_model(model, writer(), shapes, 3, np.random.default_rng(0))
        for model in (trained_model(decoder="autoregressive"), random_model(decoder="autoregressive"))
    )
    for scores in (trained, random):
        assert scores.graphs == len(shapes)
        assert scores.strings == sum(
            len(writer().strings(writer().graph(shape), 3, np.random.default_rng(0))) for shape in shapes
        )
        assert scores.voted.closes >= scores.alone.closes
        for shares in (scores.alone, scores.voted):
            assert 0 <= shares.whole <= shares.closes <= 100
            assert shares.open <= shares.tokens <= 100
    assert trained.given > random.given
    assert trained.alone.tokens > random.alone.tokens


@pytest.mark.slow
def test_reconstructed_shape_has_parts_of_original_positions() -> None:
    """Two posts, a rod and a sign are unambiguous, except for the side of the sign."""
    shape = network(2, 2)
    found = reconstruct_shape(trained_model(decoder="autoregressive"), writer(), shape, 3, np.random.default_rng(0))
    assert found is not None
    assert sorted(found.types.tolist()) == sorted(shape.types.tolist())
    first, place = found.poses[0], found.poses[:, :3, 3]
    same = [kind for kind, pose in zip(shape.types, shape.poses, strict=True) if np.allclose(pose[:3, 3], first[:3, 3])]
    assert same == [found.types[0]]
    assert np.ptp(place, axis=0).max() == pytest.approx(np.ptp(shape.poses[:, :3, 3], axis=0).max(), abs=0.7)


def test_shapes_without_strings_are_left_out() -> None:
    whole = network(1)
    parts = np.array([0, len(whole) - 2])
    apart = whole.select(parts)
    assert not len(apart.edges)
    found = score_model(random_model(decoder="lstm"), writer(), [apart, network(2)], 1, np.random.default_rng(0))
    assert (found.graphs, found.strings) == (1, 2)


def test_models_are_loaded_with_their_kits(tmp_path: Path) -> None:
    model = random_model(decoder="lstm")
    folder = tmp_path / "lstm-toy-0"
    folder.mkdir()
    header = {**model.header, "name": "lstm-toy-0"}
    (folder / "weights.safetensors").write_bytes(checkpoint_bytes(model.module.state_dict(), header))
    (found,) = category_models(tmp_path, {"toy": kit()})
    assert (found.name, found.kit, found.seed) == ("lstm", "toy", 0)
    (folder / "weights.safetensors").write_bytes(
        checkpoint_bytes(model.module.state_dict(), {**header, "names": ["post", "rod"]})
    )
    with pytest.raises(ConfigError, match=r"another names: it has 2 entries.*make train"):
        category_models(tmp_path, {"toy": kit()})


def test_table_has_rows_alone_and_voted() -> None:
    model = random_model(decoder="lstm")
    scores = CategoryScores(5, 20, 91.0, CategoryShares(90.0, 80.0, 10.0, 30.0), CategoryShares(95.0, 85.0, 40.0, 60.0))
    found = [(TrainedModel("lstm", "toy", 0, model), split, scores) for split in ("val", "test")]
    table = categories_table(found)
    assert [row[:2] + row[5:] for row in table.rows] == [
        ("lstm-toy", "test", "alone", 91.0, 90.0, 80.0, 10.0, 30.0),
        ("lstm-toy", "test", "voted", "", 95.0, 85.0, 40.0, 60.0),
        ("lstm-toy", "val", "alone", 91.0, 90.0, 80.0, 10.0, 30.0),
        ("lstm-toy", "val", "voted", "", 95.0, 85.0, 40.0, 60.0),
    ]
    (published,) = table.references_by_source()["strings, §6"]
    assert published[table.columns.index("tokens %")] == 90.0
    (row,) = clusters_table([("toy", 3, PoseClusters(10, 9, 8, 8, 8, 0.5))]).rows
    assert row == ("toy", 3, 10, 9, 8, 8, 8, 0.5)
