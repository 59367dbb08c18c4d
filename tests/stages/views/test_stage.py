"""The stage in the real pipeline: bytes, members, and what is seen of no shape."""

from __future__ import annotations

from pathlib import Path

from pipeline.config import Config
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.run import RunResult, run_stage
from pipeline.shards import read_shard
from stages.views.members import MEMBERS
from stages.views.settings import ViewsConfig
from stages.views.stage import STAGE
from tests.stages.shape.collection.absent import named_inputs
from tests.stages.sketches.test_stage import SHARDS, STAGES, toys

VIEW_STAGES = named_inputs([*(stage for name, stage in STAGES.items() if name != "sketches"), STAGE])
KEYS = {
    "cameras": [{"kind": "ring", "count": 2}, {"kind": "random", "count": 1}],
    "width": 40,
    "height": 32,
    "images": ["color", "depth", "instances", "drawing"],
}


def config_of(flat: bool = False, **keys: object) -> Config:
    base = toys(flat)
    sections = {name: section for name, section in base.sections.items() if name != "sketches"}
    return Config("toys", "1.0.0", 5, {**sections, "views": ViewsConfig.model_validate(keys)}, base.path)


def run(out: Path, config: Config, workers: int = 1) -> RunResult:
    return [run_stage(name, VIEW_STAGES, config, DatasetPaths(out, "toys"), workers) for name in VIEW_STAGES][-1]


def made(out: Path) -> dict[str, list[tuple[str, dict[str, bytes]]]]:
    return {name: list(read_shard(path)) for name in SHARDS for path in out.rglob(f"views/**/{name}.tar")}


def test_samples_have_the_declared_members_and_the_same_bytes_with_any_number_of_workers(tmp_path: Path) -> None:
    config = config_of(**KEYS)
    assert run(tmp_path / "one", config) == RunResult(made=2)
    assert run(tmp_path / "two", config, workers=2) == RunResult(made=2)
    one = made(tmp_path / "one")
    assert one == made(tmp_path / "two")
    declared = [member.name for member in MEMBERS.of(config)]
    for samples in one.values():
        assert all(list(members) == ["json", *declared] for _, members in samples)
    first, second = (members for _, members in one["toys-train-000000"][:2])
    assert first["color0.png"] != second["color0.png"]
    for content in first.values():
        assert not any(mark in content for mark in (b"tIME", b"tEXt", b"Software", b"OpenImageIO"))


def test_without_cameras_nothing_is_planned_or_declared(tmp_path: Path) -> None:
    assert Inventory(config_of(), VIEW_STAGES, DatasetPaths(tmp_path, "toys")).stage("views").shards == []
    assert not MEMBERS.of(config_of())
    assert not MEMBERS.fields(config_of())
    assert not MEMBERS.rows(config_of())


def test_a_sample_that_a_camera_does_not_see_is_rejected_and_named(tmp_path: Path) -> None:
    keys = {**KEYS, "cameras": [{"kind": "ring", "count": 1, "elevation": 0.0}]}
    assert run(tmp_path, config_of(flat=True, **keys)) == RunResult(made=2)
    (rejects,) = tmp_path.rglob("views/rejects/toys-val-000000.jsonl")
    assert "nothing seen by a camera" in rejects.read_text(encoding="utf-8")
    assert made(tmp_path)["toys-val-000000"] == []
