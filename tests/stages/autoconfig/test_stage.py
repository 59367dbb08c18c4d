"""Kits with keys at `auto` through the pipeline: resolved once, recorded, and built as an inspection would."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from stages.shape.sample import read_samples
from tests.command import shapemill
from tests.stages.variations.test_stage import write_model
from tests.stated import stated
from tests.toy_kits.chains_and_rings import ROAD, ring

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]


def run(folder: Path, stages: tuple[str, ...], out: str = "out") -> str:
    printed = ""
    for stage in stages:
        arguments = ("--config", folder / "toy.yaml", "--out", folder / out, "--workers", 1)
        code, text = shapemill("run", stage, *arguments)
        assert code == 0, text
        printed += text
    return printed


def record(folder: Path, stage: str, shard: str, out: str = "out") -> dict[str, Any]:
    path = folder / out / ".work" / "toy" / stage / "records" / f"{shard}.json"
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return a run with a kit of rings that leaves all keys at `auto`, and one that states all."""
    folder = tmp_path_factory.mktemp("autoconfig")
    shapes = [ring(*size) for size in ((1, 1), (2, 3))]
    paths = [write_model(folder / f"ring{k}.glb", ROAD, shape) for k, shape in enumerate(shapes)]
    kits = [{"name": "open", "shapes": paths}, stated({"name": "stated", "shapes": paths})]
    config = {"name": "toy", "seed": 5, "autoconfig": {"max_tries": 200}, "exemplars": {"kits": kits}}
    (folder / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    return folder, run(folder, ("autoconfig", "exemplars"))


def test_only_kits_with_auto_keys_are_resolved(made: tuple[Path, str]) -> None:
    records = made[0] / "out" / ".work" / "toy" / "autoconfig" / "records"
    assert [path.name for path in records.iterdir()] == ["open.json"]


def test_kit_is_built_with_the_recorded_settings(made: tuple[Path, str]) -> None:
    summary = record(made[0], "autoconfig", "open")["summary"]
    built = record(made[0], "exemplars", "open")["summary"]
    assert summary["resolved"]["up"] == "y"
    assert (built["resolved"], built["reasons"]) == (summary["resolved"], summary["reasons"])
    kit = json.loads((made[0] / "out" / ".work" / "toy" / "exemplars" / "open.json").read_text(encoding="utf-8"))
    assert (kit["up"], kit["strictness"]) == ("y", summary["resolved"]["grammar"])
    assert record(made[0], "exemplars", "stated")["summary"]["resolved"] == {}


def test_resolved_settings_are_printed(made: tuple[Path, str]) -> None:
    assert "open: up: y: the lowest points span more area than along the other axis; trimesh wrote the file" in made[1]


def test_near_copies_are_rejected_if_auto_finds_enough_other_variants(tmp_path: Path) -> None:
    shapes = sorted(map(str, (ROOT / "datasets" / "exemplars" / "playground").glob("*.glb")))
    kit = stated({"name": "open", "shapes": shapes, "disconnected": "auto"})
    variations = {"samples_per_kit": 24, "search": {"tries_per_round": 2000}, "splits": {"by": "graph", "shards": 1}}
    config = {"name": "toy", "exemplars": {"kits": [kit]}, "variations": variations}
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    run(tmp_path, ("autoconfig", "exemplars", "variations"))
    requirements = {"require.stable": False, "require.labels": []}
    summary = record(tmp_path, "autoconfig", "open")["summary"]["resolved"]
    assert "deck" in summary.pop("require.keep_types")
    assert summary == {"disconnected": "error", "require.max_copied_share": 0.9, **requirements}
    samples = [
        sample
        for shard in (tmp_path / "out" / ".work" / "toy" / "variations").glob("toy-t*.tar")
        for sample in read_samples(shard)
    ]
    assert samples
    assert max(sample.lineage["copied"]["share"] for sample in samples) <= 0.9
    assert record(tmp_path, "variations", "open-r000-lane00")["rejects"]["largest verbatim piece too large"] > 0


def test_exemplars_are_resized_if_there_are_too_few_layouts_as_inspect_predicts(
    made: tuple[Path, str], tmp_path: Path
) -> None:
    paths = [str(made[0] / f"ring{k}.glb") for k in (0, 1)]
    config = {
        "name": "toy",
        "autoconfig": {"max_tries": 200},
        "exemplars": {"kits": [{"name": "rings", "shapes": paths}]},
        "variations": {"samples_per_kit": 12, "splits": {"by": "graph", "val": 0.25, "shards": 1}},
    }
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    text = run(tmp_path, ("autoconfig", "exemplars", "variations", "proportions"))
    assert "rings: fallback: rows: 100% of what is drawn holds together; of other layouts about 19" in text
    work = tmp_path / "out" / ".work" / "toy"
    assert not list((work / "variations").glob("toy-*.tar"))
    samples = [sample for shard in (work / "proportions").glob("toy-*.tar") for sample in read_samples(shard)]
    assert sorted(sample.split for sample in samples) == ["test"] + 8 * ["train"] + 3 * ["val"]
    assert {sample.lineage["method"] for sample in samples} == {"proportions", "rows"}
    code, text = shapemill("inspect", *paths, "--json", "--tries", 200)
    assert code == 0, text
    result = json.loads(text)
    assert result["autoconfig"]["resolved"] == record(tmp_path, "autoconfig", "rings")["summary"]["resolved"]
    assert result["autoconfig"]["resolved"]["proportions.require.stable"] is True
    config["variations"] |= {"fallback": "nothing"}
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    run(tmp_path, ("autoconfig",))
    assert "fallback" not in record(tmp_path, "autoconfig", "rings")["summary"]["resolved"]


def test_written_config_makes_shapes(made: tuple[Path, str], tmp_path: Path) -> None:
    """Two rings have 16 other layouts, too few for a dataset, so resizing is proposed; layouts work, too."""
    paths = [str(made[0] / f"ring{k}.glb") for k in (0, 1)]
    code, text = shapemill("inspect", *paths, "--tries", 200, "--out", tmp_path)
    assert code == 0, text
    written = yaml.safe_load((tmp_path / "ring0.yaml").read_text(encoding="utf-8"))
    written["name"] = "toy"
    assert written["variations"] == {"samples_per_kit": 0, "rows": {"use": True}}
    written["proportions"] |= {"samples_per_kit": 8}
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(written), encoding="utf-8")
    run(tmp_path, ("autoconfig", "exemplars", "proportions"))
    work = tmp_path / "out" / ".work" / "toy"
    assert not list((work / "autoconfig").glob("*.json"))
    made_shapes = [sample for shard in (work / "proportions").glob("toy-*.tar") for sample in read_samples(shard)]
    assert "rows" in {sample.lineage["method"] for sample in made_shapes}, "what the forecast promises is made"
    del written["proportions"]
    written["variations"] = {
        "samples_per_kit": 8,
        "search": {"duplicates": "graph", "tries_per_round": 400, "patience": 800},
    }
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(written), encoding="utf-8")
    run(tmp_path, ("autoconfig", "exemplars", "variations"))
    assert list((work / "variations").glob("toy-train-*.tar"))
