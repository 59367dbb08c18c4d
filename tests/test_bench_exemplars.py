"""Which models the table of exemplars is about."""

from __future__ import annotations

from pathlib import Path

from tests.bench.exemplars import kits


def test_an_argument_is_a_model_some_models_of_one_kit_or_a_folder_of_models(tmp_path: Path) -> None:
    a, b = tmp_path / "a b.glb", tmp_path / "far" / "model.glb"
    b.parent.mkdir()
    for item in (a, b):
        item.touch()
    assert list(kits(str(a))) == [[a]]
    assert list(kits(f"{b} {b}")) == [[b, b]]
    assert list(kits(str(tmp_path))) == [[a], [b]]
