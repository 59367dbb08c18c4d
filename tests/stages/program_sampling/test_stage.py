"""What cannot be written is said; what is written, in the test of the models that write."""

from __future__ import annotations

from pathlib import Path

import yaml

from tests.command import shapemill


def test_a_model_that_is_not_there_is_said_with_what_makes_it(tmp_path: Path) -> None:
    source = {"name": "stool", "dataset": "toy", "model": "tiny", "kit": "furniture", "samples": 12}
    config = tmp_path / "dreamt.yaml"
    config.write_text(yaml.safe_dump({"name": "dreamt", "seed": 5, "shapeassembly": {"sampled": [source]}}))
    code, printed = shapemill("run", "program_sampling", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code
    assert "toy-models/tiny-furniture-0/weights.safetensors" in printed
    assert "MODEL=tiny" in printed
