"""A config asks for what it wants and nothing else: here meshes and images, without points, strings and sketches."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet
import pytest
import yaml

from pipeline.config import Config, load_config
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.shards import read_shard
from stages.captions.settings import CaptionsConfig
from stages.exports.settings import ExportsConfig
from stages.package.reader import Dataset
from stages.points.settings import PointsConfig
from stages.sketches.settings import SketchesConfig
from stages.strings.settings import StringsConfig
from stages.structure.settings import StructureConfig
from stages.surface.settings import SurfaceConfig
from stages.variations.report.sheet import write_sheets
from stages.verification.verify import verify_dataset
from stages.views.settings import RingCameras, ViewsConfig
from tests.stages.package.toy import make_toy, toy_config

TEMPLE = Path(__file__).resolve().parents[3] / "datasets" / "exemplars" / "temple"


def images_alone() -> Config:
    config = toy_config(shards=1)
    off = {
        "points": PointsConfig.model_validate(False),
        "strings": StringsConfig.model_validate(False),
        "sketches": SketchesConfig(views=()),
        "surface": SurfaceConfig(),
        "captions": CaptionsConfig(),
        "exports": ExportsConfig(),
        "structure": StructureConfig(),
        "views": ViewsConfig(cameras=(RingCameras(count=2),), width=24, height=24, images=("color", "instances")),
    }
    return replace(config, sections={**config.sections, **off})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_toy(tmp_path_factory.mktemp("images"), images_alone())


def test_samples_hold_what_was_asked_for_and_what_a_dataset_needs(folder: Path) -> None:
    samples = [members for path in folder.rglob("*.tar") for _, members in read_shard(path)]
    images = ["color0.png", "instances0.png", "color1.png", "instances1.png"]
    assert [list(members) for members in samples] == [["glb", "contacts.npy", "joints.npy", *images, "json"]] * 6
    record = json.loads(samples[0]["json"])
    assert not {"text", "points", "sketches"} & set(record)
    assert not {"text", "points", "sketches"} & set(json.loads((folder / "schema.json").read_bytes())["properties"])
    index = pyarrow.parquet.read_table(folder.parent / "toy-index/toy.parquet")
    assert {"key", "stable", "parts"} <= set(index.column_names)
    assert "text" not in index.column_names


def test_it_is_verified_without_a_fault_and_its_views_are_read(folder: Path, tmp_path: Path) -> None:
    findings = verify_dataset(folder, None, 0)
    assert findings.faults == {}, findings.lines()
    for sample in Dataset.open(folder):
        assert [view.color.shape for view in sample.views] == [(24, 24, 3)] * 2
        assert {-1} < set(sample.views[0].instances.ravel().tolist()) <= set(range(-1, len(sample.record["parts"])))
        assert sample.sketches == ()
    sample.export_views(tmp_path / sample.key)
    exported = json.loads((tmp_path / sample.key / "transforms.json").read_bytes())
    assert all((tmp_path / sample.key / frame["file_path"]).is_file() for frame in exported["frames"])


def test_the_card_speaks_of_what_there_is(folder: Path) -> None:
    card = (folder / "README.md").read_text(encoding="utf-8")
    assert "points" not in card.lower()
    assert 'sample["color0.png"]' in card
    assert '.records("color0-of-samples")' in card


def test_false_turns_a_section_off_and_true_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("name: c\npoints: false\n", encoding="utf-8")
    config = load_config(path, {"points": PointsConfig, "strings": StringsConfig})
    assert not config.section(PointsConfig).enabled
    assert config.section(StringsConfig).enabled
    path.write_text("name: c\npoints: true\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"c\.yaml:2: points: "):
        load_config(path, {"points": PointsConfig})


def test_a_model_of_strings_needs_strings(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("name: c\nstrings: false\ntraining: {models: [{name: m, kind: string_vae}]}\n", encoding="utf-8")
    stages = find_stages()
    config = load_config(path, {name: stage.config for name, stage in stages.items()})
    with pytest.raises(ConfigError, match="m: it learns from strings, which are turned off"):
        stages["training"].check(config)


def test_a_model_of_strings_needs_shapes_with_strings(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    settings = {
        "name": "c",
        "exemplars": {"kits": [{"name": "k", "shapes": [str(next(TEMPLE.glob("*.glb")))]}]},
        "variations": {"samples_per_kit": 0},
        "proportions": {"samples_per_kit": 5},
        "training": {"models": [{"name": "m", "kind": "string_vae"}]},
    }
    stages = find_stages()
    for samples_per_kit in (5, 0):
        settings["variations"] = {"samples_per_kit": samples_per_kit}
        path.write_text(yaml.safe_dump(settings), encoding="utf-8")
        config = load_config(path, {name: stage.config for name, stage in stages.items()})
        if samples_per_kit:
            stages["training"].check(config)
    with pytest.raises(ConfigError, match="no shape of this config has one: shapes in other proportions"):
        stages["training"].check(config)
    with pytest.raises(ConfigError, match=r"variations\.samples_per_kit is 0, and sheets show variations"):
        write_sheets(config, DatasetPaths(tmp_path, "c"))
