"""The figures of models of edge categories."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.engine.models import TrainedModel
from eval.generated.edge_categories import (
    Judged,
    Shares,
    categories_table,
    category_models,
    clusters_table,
    judge,
    read_back,
)
from eval.generated.pose_clusters import Clusters
from pipeline.errors import ConfigError
from stages.training.checkpoint import checkpoint_bytes
from tests.stages.training.edge_categories.networks import kit, network, random_model, trained_model, writer


@pytest.mark.slow
def test_a_model_that_has_learnt_is_right_more_often_and_strings_that_vote_agree_on_shapes_that_close() -> None:
    shapes = [network(seed) for seed in range(6)]
    learnt, random = (
        judge(model, writer(), shapes, 3, np.random.default_rng(0))
        for model in (trained_model(decoder="autoregressive"), random_model(decoder="autoregressive"))
    )
    for each in (learnt, random):
        assert each.graphs == len(shapes)
        assert each.strings == sum(
            len(writer().strings(writer().graph(shape), 3, np.random.default_rng(0))) for shape in shapes
        )
        assert each.voted.closes >= each.alone.closes
        for shares in (each.alone, each.voted):
            assert 0 <= shares.whole <= shares.closes <= 100
            assert shares.open <= shares.tokens <= 100
    assert learnt.given > random.given
    assert learnt.alone.tokens > random.alone.tokens


@pytest.mark.slow
def test_what_is_read_back_stands_where_the_shape_stands() -> None:
    """Two posts, a rod and a sign leave little to guess: the same places, or the sign at another side."""
    shape = network(2, 2)
    found = read_back(trained_model(decoder="autoregressive"), writer(), shape, 3, np.random.default_rng(0))
    assert found is not None
    assert sorted(found.types.tolist()) == sorted(shape.types.tolist())
    first, place = found.poses[0], found.poses[:, :3, 3]
    same = [kind for kind, pose in zip(shape.types, shape.poses, strict=True) if np.allclose(pose[:3, 3], first[:3, 3])]
    assert same == [found.types[0]]
    assert np.ptp(place, axis=0).max() == pytest.approx(np.ptp(shape.poses[:, :3, 3], axis=0).max(), abs=0.7)


def test_shapes_that_have_no_string_are_left_out() -> None:
    whole = network(1)
    parts = np.array([0, len(whole) - 2])
    apart = whole.select(parts)
    assert not len(apart.edges)
    found = judge(random_model(decoder="lstm"), writer(), [apart, network(2)], 1, np.random.default_rng(0))
    assert (found.graphs, found.strings) == (1, 2)


def test_models_are_read_beside_their_kits(tmp_path: Path) -> None:
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


def test_a_row_says_what_strings_say_alone_and_one_what_they_vote_for() -> None:
    model = random_model(decoder="lstm")
    judged = Judged(5, 20, 91.0, Shares(90.0, 80.0, 10.0, 30.0), Shares(95.0, 85.0, 40.0, 60.0))
    found = [(TrainedModel("lstm", "toy", 0, model), split, judged) for split in ("val", "test")]
    table = categories_table(found)
    assert [row[:2] + row[5:] for row in table.rows] == [
        ("lstm-toy", "test", "alone", 91.0, 90.0, 80.0, 10.0, 30.0),
        ("lstm-toy", "test", "voted", "", 95.0, 85.0, 40.0, 60.0),
        ("lstm-toy", "val", "alone", 91.0, 90.0, 80.0, 10.0, 30.0),
        ("lstm-toy", "val", "voted", "", 95.0, 85.0, 40.0, 60.0),
    ]
    (published,) = table.published_by_source()["strings, §6"]
    assert published[table.columns.index("tokens %")] == 90.0
    (row,) = clusters_table([("toy", 3, Clusters(10, 9, 8, 8, 8, 0.5))]).rows
    assert row == ("toy", 3, 10, 9, 8, 8, 8, 0.5)
