"""A missing model is reported; sampled programs are tested with the models."""

from __future__ import annotations

from pathlib import Path

import yaml

from tests.command import shapemill


def test_missing_model_is_reported_with_the_command_that_trains_it(tmp_path: Path) -> None:
    source = {"name": "stool", "dataset": "toy", "model": "tiny", "kit": "furniture", "samples": 12}
    config = tmp_path / "sampled.yaml"
    config.write_text(
        yaml.safe_dump({"name": "sampled", "seed": 5, "shapeassembly": {"sampled": [source]}}), encoding="utf-8"
    )
    code, printed = shapemill("run", "program_sampling", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code
    assert "toy-models/tiny-furniture-0/weights.safetensors" in printed
    assert "MODEL=tiny" in printed
