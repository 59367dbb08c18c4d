"""Metrics of string VAEs, on small models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.engine.models import TrainedModel, training_curve
from eval.strings.string_vaes import (
    Reconstruction,
    Sampling,
    corpus_strings,
    model_rng,
    reconstruction,
    reconstruction_table,
    sampling,
    sampling_table,
    shape_graphs,
    string_vaes,
    structure,
    structure_table,
)
from pipeline.errors import ConfigError
from stages.training.checkpoint import checkpoint_bytes
from stages.training.model_folder import curves_csv
from stages.training.string_vae.latent_graph import PathFigures
from stages.training.string_vae.latent_sampling import SAMPLING_METHODS, sample
from stages.training.string_vae.trained import TrainedStringVae
from tests.stages.training.string_vae.models import LEARNT_SHAPES, MAX_TOKENS, random_vae, toy_strings, trained_vae


@pytest.mark.slow
def test_overfitted_model_reconstructs_and_random_model_does_not() -> None:
    strings = toy_strings(2 * LEARNT_SHAPES)  # half of the shapes are unknown, so that figures differ
    trained, random = (reconstruction(model, strings) for model in (trained_vae("transformer"), random_vae("masked")))
    assert trained.strings == len(strings)
    assert trained.valid == random.valid == 100
    assert trained.graphs >= trained.same > 30 > random.same
    assert trained.tokens > trained.same


@pytest.mark.parametrize("method", SAMPLING_METHODS)
def test_sampling_shares_are_percentages(method: str) -> None:
    strings = toy_strings()
    model = random_vae("masked")
    figures = sampling(model, method, strings, shape_graphs(model, strings), 30, np.random.default_rng(0))
    assert figures.valid == 100
    assert 0 < figures.found <= 100
    assert 0 < figures.unique <= 100
    plain = sampling(random_vae("plain"), "prior", strings, set(), 30, np.random.default_rng(0))
    assert plain.valid < 50


def test_known_strings_are_not_novel() -> None:
    model = random_vae("masked")
    found = sample(model, "prior", toy_strings(), 60, np.random.default_rng(7))
    sampled = [result.string for result in found if result.string]
    toys = shape_graphs(model, toy_strings())
    known, fresh = (
        sampling(model, "prior", toy_strings(), graphs, 60, np.random.default_rng(7))
        for graphs in (toys | shape_graphs(model, sampled), toys)
    )
    assert known.novel == 0
    assert fresh.novel > 0


@pytest.mark.slow
def test_search_graph_of_trained_model_is_more_connected() -> None:
    nodes, figures = structure(trained_vae("transformer"), toy_strings(), np.random.default_rng(0))
    assert nodes == len(toy_strings())
    assert set(figures) == {"naive", "search graph"}
    assert figures["search graph"].components <= figures["naive"].components


def test_models_are_loaded_with_kit_and_seed(tmp_path: Path) -> None:
    model = random_vae("masked")
    for name in ("masked-space-base-0", "masked-space-base-1", "plain-toy-0"):
        kit = "toy" if "toy" in name else "space-base"
        (tmp_path / name).mkdir()
        header = {**model.header, "kind": "string_vae", "kit": kit, "name": name}
        content = checkpoint_bytes(model.module.state_dict(), header)
        (tmp_path / name / "weights.safetensors").write_bytes(content)
    (tmp_path / "other-toy-0").mkdir()
    content = checkpoint_bytes(model.module.state_dict(), {"kind": "another", "kit": "toy", "name": "other-toy-0"})
    (tmp_path / "other-toy-0" / "weights.safetensors").write_bytes(content)
    found = [(trained.name, trained.kit, trained.seed) for trained in string_vaes(tmp_path)]
    assert found == [("masked", "space-base", 0), ("masked", "space-base", 1), ("plain", "toy", 0)]


def test_unreadable_weights_are_reported(tmp_path: Path) -> None:
    (tmp_path / "masked-toy-0").mkdir()
    (tmp_path / "masked-toy-0" / "weights.safetensors").write_bytes(b"\x80\x04 a pickle")
    with pytest.raises(ConfigError, match=r"masked-toy-0/weights\.safetensors is a pickle.*make train"):
        string_vaes(tmp_path)


def test_training_curve_reads_the_log(tmp_path: Path) -> None:
    rows = [{"round": number, "step": 10 * number, "val_nats": 9.0 - number} for number in range(3)]
    (tmp_path / "curves.csv").write_text(curves_csv(rows), encoding="utf-8")
    assert training_curve(tmp_path, "val_nats") == [(0.0, 9.0), (10.0, 8.0), (20.0, 7.0)]


def test_unreadable_strings_are_left_out(tmp_path: Path) -> None:
    model = random_vae("masked")
    (tmp_path / "toy-test.txt").write_text(
        "".join(f"{line}\n" for line in [*toy_strings()[:3], "AZ", "B(B)"]), encoding="utf-8"
    )
    assert corpus_strings(tmp_path, "toy", "test", model) == list(toy_strings()[:3])
    assert max(map(len, toy_strings())) <= MAX_TOKENS


def as_trained(model: TrainedStringVae, seed: int) -> TrainedModel[TrainedStringVae]:
    return TrainedModel("masked", "toy", seed, model)


def test_seeds_share_a_row_with_mean_and_deviation() -> None:
    model = random_vae("masked")
    found = [(as_trained(model, seed), Reconstruction(9, 90.0 + seed, 50.0, 60.0, 100.0)) for seed in range(3)]
    (row,) = reconstruction_table(found).rows
    assert row == ("masked-toy", 3, 9, "91.0 ± 1.0", "50.0 ± 0.0", "60.0 ± 0.0", "100.0 ± 0.0")
    (row,) = reconstruction_table(found[:1]).rows
    assert row == ("masked-toy", 1, 9, 90.0, 50.0, 60.0, 100.0)
    searches = [(as_trained(model, 0), method, Sampling(5, 100.0, 80.0, 70.0, 60.0)) for method in ("path", "prior")]
    assert [row[:4] for row in sampling_table(searches).rows] == [
        ("masked-toy", "path", 1, 5),
        ("masked-toy", "prior", 1, 5),
    ]


def test_structure_table_has_reference_rows() -> None:
    table = structure_table([(as_trained(random_vae("masked"), 0), 7, {"naive": PathFigures(2, 0.5, 1.5)})])
    assert table.rows == (("masked-toy-0, naive", 7, 2, 0.5, 1.5),)
    assert "| sand castle, naive (strings, Table 2) |  | 102 | 4.71 | 12.2 |" in table.markdown()


def test_every_decision_of_every_model_has_its_own_rng() -> None:
    model = random_vae("masked")
    streams = [
        model_rng(1, as_trained(model, seed), decision).random() for seed in (0, 1) for decision in ("path", "prior")
    ]
    assert len(set(streams)) == 4
