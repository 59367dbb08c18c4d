"""An encoder of clouds in the real pipeline: shapes of a dataset to published weights."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from safetensors.numpy import load_file

from stages.training.load import load_model
from stages.training.point_encoder.trained import TrainedPointEncoder
from stages.training.ship import slim_bytes
from tests.command import shapemill

ENTRY = {"name": "tiny", "kind": "point_encoder", "points": 64, "batch_size": 2, "steps": 3, "max_rounds": 2}


@pytest.mark.slow
def test_encoder_learns_from_all_samples_of_a_mixture(tmp_path: Path) -> None:
    """Two producers; of train only six shapes are drawn. The weights are published with card and curves."""
    config = tmp_path / "toy.yaml"
    sections = {
        "mixture": True,
        "primitives": {"samples": 10},
        "programs": [{"program": "table", "mode": "random", "random": {"samples": 8}}],
        "strings": False,
        "sketches": False,
        "points": False,
        "training": {"models": [{**ENTRY, "max_shapes": 6}]},
    }
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 3, **sections}), encoding="utf-8")
    code, printed = shapemill("train", "--config", config, "--out", tmp_path, "--workers", 1)
    assert code == 0, printed

    prepared = tmp_path / ".work/toy/training"
    clouds = load_file(prepared / "toy-point_encoder-6.train.safetensors")
    assert clouds["points"].shape == (6, 2048, 3)
    np.testing.assert_allclose(np.linalg.norm(np.ptp(clouds["points"], axis=1), axis=1), 1.0, atol=1e-5)
    assert all(len(np.unique(parts)) > 1 for parts in clouds["parts"])

    model = load_model(tmp_path / "toy-models" / "tiny-toy-0", {"collection": "toy"})
    assert isinstance(model, TrainedPointEncoder)
    cloud = 40.0 * np.random.default_rng(0).random((50, 3))
    embedded = model.embed(cloud)
    assert embedded.shape == (50, 32)
    np.testing.assert_allclose(np.linalg.norm(embedded, axis=1), 1.0, atol=1e-5)
    for wrong in (cloud[:0], cloud[:, :2], np.full((4, 3), np.nan)):
        with pytest.raises(ValueError, match="a cloud is finite points"):
            model.embed(wrong)
        with pytest.raises(ValueError, match="a cloud is finite points"):
            model.describe(wrong)
    description = model.describe(cloud)
    assert description.shape == (128,)
    np.testing.assert_allclose(model.describe(3.0 * cloud[::-1] + 7.0), description, atol=1e-3)
    card = (tmp_path / "toy-models" / "tiny-toy-0" / "README.md").read_text(encoding="utf-8")
    assert "A `point_encoder` of collection `toy`" in card
    assert json.dumps(model.header["counts"]["train"]) == '{"shapes": 6}'

    shipped = tmp_path / "weights.safetensors"
    shipped.write_bytes(slim_bytes(tmp_path / "toy-models" / "tiny-toy-0" / "weights.safetensors"))
    assert shipped.stat().st_size < 300_000, "half precision"
    np.testing.assert_allclose(load_model(shipped).embed(cloud), embedded, atol=0.02)
