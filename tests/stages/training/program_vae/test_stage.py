"""Training on the real mill: programs of a dataset to published weights."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from eval.__main__ import main as evaluate
from stages.shapeassembly import parse
from stages.training.program_vae.trained import load_program_vae
from tests.mill import mill

EXAMPLES = sorted(Path("datasets/exemplars/programs").glob("*.txt"))


@pytest.mark.slow
def test_a_model_of_programs_is_trained_and_read_again(tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    for path in EXAMPLES:
        for number in range(2):
            text = path.read_text().replace("0.5, 0.0, 0.5, 0.5, 1.0, 0.5", f"0.5, 0.0, 0.5, 0.5, 1.0, 0.5{number}")
            (tmp_path / "programs" / f"{path.stem}-{number}.txt").write_text(text)
    model = {"name": "tiny", "kind": "program_vae", "latent": 8, "hidden": 32, "batch": 4, "steps": 30, "rounds": 2}
    sections = {
        "shapeassembly": {
            "programs": [{"name": "furniture", "path": str(tmp_path / "programs")}],
            "splits": {"shards": 1, "val": 0.2, "test": 0.2},
        },
        "training": {"models": [model]},
    }
    config = tmp_path / "toy.yaml"
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 5, **sections}))
    out = tmp_path / "out"
    for stage in ("shapeassembly", "training"):
        code, printed = mill("run", stage, "--config", config, "--out", out, "--workers", 1)
        assert code == 0, printed
    counts = json.loads((out / ".work/toy/training/furniture-program_vae.json").read_text())["counts"]
    assert counts["train"]["programs"] >= 5
    trained = load_program_vae(out / "toy-models/tiny-furniture-0/weights.safetensors", {"kit": "furniture"})
    points = trained.encode([parse(path.read_text()) for path in EXAMPLES[:3]])
    assert points.shape == (3, 8)
    again = [trained.decode(points, reject=False) for _ in range(2)]
    assert again[0] == again[1]
    assert np.isfinite(points).all()
    asked = ["--config", str(config), "--out", str(out), "--samples", "2", "--sequences", "1", "--steps", "4"]
    assert evaluate(["shapeassembly", *asked]) == 0
    table = (out / "toy-eval/shapeassembly.md").read_text()
    assert all(row in table for row in ("tiny-furniture-0", "furniture, val", "storage, ShapeAssembly"))
