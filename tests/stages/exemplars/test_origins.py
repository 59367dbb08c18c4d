"""Credits of exemplars: stated in the config, requested if missing, and no reason to rebuild shapes."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipeline.config import Config, load_config
from pipeline.errors import ConfigError
from stages.exemplars.origins import exemplar_origins
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.origin import missing_licenses


def config_of(folder: Path, *kits: dict[str, Any]) -> Config:
    path = folder / "kits.yaml"
    path.write_text(yaml.safe_dump({"name": "kits", "exemplars": {"kits": list(kits)}}), encoding="utf-8")
    return load_config(path, {"exemplars": ExemplarsConfig})


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    paths = [tmp_path / "models" / name for name in ("one.glb", "two.glb")]
    paths[0].parent.mkdir()
    for path in paths:
        path.write_bytes(path.name.encode())
    return [str(path) for path in paths]


def test_file_has_the_credit_of_its_kit_unless_it_has_its_own(files: list[str], tmp_path: Path) -> None:
    own = {"path": files[1], "credit": {"author": "B", "license": "CC0-1.0"}}
    kit = {"author": "A", "license": "MIT", "source": "https://example.org", "notice": "Copyright A"}
    one, two = exemplar_origins(config_of(tmp_path, {"name": "k", "shapes": [files[0], own], "credit": kit}))
    assert (one.file, one.author, one.license, one.source, one.notice) == (
        "models/one.glb",
        *("A", "MIT", "https://example.org", "Copyright A"),
    )
    assert (two.author, two.license, two.source, two.notice) == ("B", "CC0-1.0", "", "")
    assert one.sha256 == hashlib.sha256(b"one.glb").hexdigest()
    assert missing_licenses([one, two]) == []


def test_licence_that_nobody_states_is_asked_for_by_name(files: list[str], tmp_path: Path) -> None:
    origins = exemplar_origins(config_of(tmp_path, {"name": "k", "shapes": files[:1], "credit": {"author": "A"}}))
    (sentence,) = missing_licenses(origins)
    assert sentence.startswith("licence of models/one.glb: not stated; say it with exemplars.kits[k].credit")


def test_credit_changes_nothing_that_shapes_are_made_by(files: list[str], tmp_path: Path) -> None:
    bare = config_of(tmp_path, {"name": "k", "shapes": files}).section(ExemplarsConfig)
    stated = [{"path": file, "credit": {"author": "B"}} for file in files]
    full = config_of(tmp_path, {"name": "k", "shapes": stated, "credit": {"license": "MIT"}}).section(ExemplarsConfig)
    assert bare.model_dump(mode="json") == full.model_dump(mode="json")


def test_mistake_in_a_shape_is_named_with_its_place(files: list[str], tmp_path: Path) -> None:
    wrong = [files[0] + "b", {"path": files[0], "autor": "A"}]
    with pytest.raises(ConfigError) as error:
        config_of(tmp_path, {"name": "k", "shapes": wrong})
    assert f"exemplars.kits[k].shapes[{files[0]}b]: there is no file" in str(error.value)
    assert f"exemplars.kits[k].shapes[{files[0]}].autor: unknown key" in str(error.value)
