"""The stage in the real pipeline, after two small stages that make a kit and a collection."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.config import Config, StrictModel
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.run import RunResult, run_stage
from pipeline.shards import ShardWriter, read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from pipeline.status import status_lines
from stages.shape.kit import Assembly
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, write_sample
from stages.shape.views.raster import RasterRenderer
from stages.shape.views.renderer_check import check_in_subprocess
from stages.sketches.settings import Augmentation, SketchesConfig, SketchView
from stages.sketches.stage import STAGE
from tests.stages.shape.collection.absent import ABSENT_SECTIONS, ABSENT_STAGES, named_inputs
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type, posed
from tests.stages.sketches.png import png_array

SHARDS = {"toys-train-000000": ("train", 3), "toys-val-000000": ("val", 2)}


class KitsConfig(StrictModel):
    """No keys."""


class ShapesConfig(StrictModel):
    """flat: whether one shape is a sheet that the first view sees edge-on."""

    flat: bool = False


def make_kit(task: Task) -> Outcome:
    sheet = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1]]), np.array([[0, 1, 2]], dtype=np.int32)
    kit = kit_of(part_type("box", box()), part_type("drum", cylinder(24, 0.4, 1.0)), part_type("sheet", sheet))
    with task.output("solids.json") as text, task.output("solids.tar") as arrays:
        write_kit(kit, text, arrays)
    return Outcome(1)


def plan_shapes(plan: Plan) -> list[Shard]:
    return [Shard(name, inputs=("exemplars/solids",)) for name in SHARDS]


def make_shapes(task: Task) -> Outcome:
    split, count = SHARDS[task.shard.name]
    flat = task.config.section(ShapesConfig).flat and split == "val"
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for index in range(count):
            types = np.array([2] if flat else [0, 1, 0][: index + 1], dtype=np.int16)
            poses = posed(*[(k, 0.0, 0.0) for k in range(len(types))])
            edges = np.array([(k, k + 1) for k in range(len(types) - 1)], dtype=np.int32).reshape(-1, 2)
            assembly = Assembly(types, poses, edges)
            write_sample(writer, Sample(f"{split}-{index}", split, "variations", "solids", "0" * 64, {}, assembly))
    return Outcome(count, {"split": split, "samples": count})


def small(plan: Plan) -> int:
    return 100_000


STAGES = named_inputs(
    [
        *ABSENT_STAGES.values(),
        Stage("exemplars", __name__, KitsConfig, (), lambda plan: [Shard("solids")], make_kit, small),
        Stage("variations", __name__, ShapesConfig, ("exemplars",), plan_shapes, make_shapes, small),
        STAGE,
    ]
)


def toys(flat: bool = False, **keys: object) -> Config:
    """The config of a small dataset; `keys` are of the section `sketches`."""
    sketches = SketchesConfig.model_validate({"size": 48, "renderer": "raster", **keys})
    sections = {
        **ABSENT_SECTIONS,
        "exemplars": KitsConfig(),
        "variations": ShapesConfig(flat=flat),
        "sketches": sketches,
    }
    return Config(name="toys", version="1.0.0", seed=5, sections=sections, path=Path("toys.yaml"))


def turn(out: Path, flat: bool = False, **keys: object) -> dict[str, RunResult]:
    """Run all stages in this process."""
    config = toys(flat, **keys)
    return {name: run_stage(name, STAGES, config, DatasetPaths(out, "toys"), workers=1) for name in STAGES}


def made(out: Path, **keys: object) -> dict[str, list[tuple[str, dict[str, bytes]]]]:
    """The samples of each shard of sketches, from a run of all stages."""
    assert turn(out, **keys)["sketches"] == RunResult(made=2)
    return {name: list(read_shard(next(out.rglob(f"sketches/**/{name}.tar")))) for name in SHARDS}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[str, dict[str, bytes]]]]:
    """The samples of a run without augmentations."""
    return made(tmp_path_factory.mktemp("plain"))


def test_every_sample_gets_one_drawing_per_view(plain):
    assert [key for key, _ in plain["toys-train-000000"]] == ["train-0", "train-1", "train-2"]
    for samples in plain.values():
        for _, members in samples:
            assert sorted(members) == ["json", "sketch0.png", "sketch1.png", "sketch2.png"]
            drawings = [png_array(members[name]) for name in sorted(members) if name.endswith(".png")]
            assert all(drawing.shape == (48, 48) and drawing.min() < 128 for drawing in drawings)
            assert not (drawings[0] == drawings[2]).all()


def test_the_same_config_gives_the_same_bytes(tmp_path):
    view = SketchView(name="wandering", azimuth_jitter=20.0).model_dump()
    one, two = (made(tmp_path / name, views=[view]) for name in ("one", "two"))
    assert one == two
    first, second = (members["sketch0.png"] for _, members in one["toys-train-000000"][:2])
    assert first != second


def test_run_does_not_start_if_the_renderer_cannot_draw(tmp_path, monkeypatch):
    (tmp_path / "pyrender.py").write_text(
        "raise ImportError('libXrender.so.1: cannot open shared object file')\n", encoding="utf-8"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    check_in_subprocess.cache_clear()
    try:
        with pytest.raises(ConfigError, match=r"toys\.yaml: sketches\.renderer: egl cannot draw .*libXrender.*doctor"):
            turn(tmp_path / "out", renderer="egl")
    finally:
        check_in_subprocess.cache_clear()
    assert not list((tmp_path / "out").rglob("*.tar")) + list((tmp_path / "out").rglob("*.npy"))


def test_the_records_and_the_report_say_what_drew(tmp_path):
    turn(tmp_path)
    records = [json.loads(path.read_bytes()) for path in tmp_path.rglob("sketches/records/*.json")]
    drawn = {(record["summary"]["renderer"], record["summary"]["renderer_version"]) for record in records}
    assert len(records) == 2
    assert drawn == {("raster", RasterRenderer.name)}
    status = list(status_lines(toys(), STAGES, DatasetPaths(tmp_path, "toys"), workers=1))
    assert f"sketches: 2 shards drawn by raster, {RasterRenderer.name}" in status


def test_augmented_drawings_keep_their_members(tmp_path, plain):
    thickened = made(tmp_path, augment=Augmentation(flip=0.5, dilate=1.0).model_dump())
    for name in SHARDS:
        for (_, thick), (_, thin) in zip(thickened[name], plain[name], strict=True):
            assert sorted(thick) == sorted(thin)
            assert png_array(thick["sketch0.png"]).mean() < png_array(thin["sketch0.png"]).mean()


def test_a_blank_drawing_fails_the_shard_and_names_the_sample(tmp_path):
    view = SketchView(name="edge_on", azimuth=0.0, elevation=0.0).model_dump()
    failed = turn(tmp_path, flat=True, views=[view])["sketches"].failed
    assert list(failed) == ["toys-val-000000"]
    assert "val-0, view edge_on: blank picture" in failed["toys-val-000000"]
