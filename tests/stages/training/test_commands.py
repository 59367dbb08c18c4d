"""The command `train`."""

from __future__ import annotations

from pathlib import Path

from tests.command import shapemill


def test_a_config_without_models_is_refused(tmp_path: Path) -> None:
    (tmp_path / "heaps.yaml").write_text("{name: heaps, primitives: {samples: 4}}", encoding="utf-8")
    code, printed = shapemill("train", "--config", tmp_path / "heaps.yaml", "--out", tmp_path)
    assert (code, "has no training.models to train" in printed) == (2, True), printed
