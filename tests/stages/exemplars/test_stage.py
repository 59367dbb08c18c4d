"""The stage in the real pipeline."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pipeline.config import Config, load_config
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.status import status_lines
from stages.autoconfig.stage import STAGE as AUTOCONFIG
from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import ExemplarsConfig
from stages.exemplars.stage import STAGE
from stages.shape.kit_files import kit_json, load_kit
from stages.variations.settings import VariationsConfig
from tests.stages.exemplars.model_files import box, write_obj
from tests.stated import stated

STAGES = {"autoconfig": AUTOCONFIG, "exemplars": STAGE}

pytestmark = pytest.mark.slow


def blocks(count: int, gap: float = 0.0) -> dict[str, np.ndarray]:
    return {f"block.{k:03d}": box(at=(k * (1 + gap), 0, 0)) for k in range(count)}


def write_config(folder: Path, kits: list[dict[str, Any]]) -> Config:
    import yaml

    path = folder / "toy.yaml"
    path.write_text(
        yaml.safe_dump({"name": "toy", "exemplars": {"kits": [stated(kit) for kit in kits]}}), encoding="utf-8"
    )
    return load_config(path, {**{name: stage.config for name, stage in STAGES.items()}, "variations": VariationsConfig})


def run(folder: Path, config: Config, out: str = "out") -> tuple[str, ...]:
    """Return the shards that failed."""
    return tuple(run_stage("exemplars", STAGES, config, DatasetPaths(folder / out, config.name), 1).failed)


def files(folder: Path, out: str = "out") -> dict[str, bytes]:
    root = folder / out / ".work" / "toy" / "exemplars"
    return {path.name: path.read_bytes() for path in sorted(root.iterdir()) if path.is_file()}


def record(folder: Path, shard: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(
        (folder / "out" / ".work" / "toy" / "exemplars" / "records" / f"{shard}.json").read_text(encoding="utf-8")
    )
    return content


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Config]:
    folder = tmp_path_factory.mktemp("exemplars")
    write_obj(folder / "short.obj", blocks(3))
    write_obj(folder / "long.obj", blocks(5))
    shapes = [str(folder / "short.obj"), str(folder / "long.obj")]
    config = write_config(folder, [{"name": "row", "shapes": shapes}, {"name": "short", "shapes": shapes[:1]}])
    assert run(folder, config) == ()
    return folder, config


def test_kit_is_a_shard_of_three_files(made: tuple[Path, Config]) -> None:
    assert list(files(made[0])) == [f"{kit}.{kind}" for kit in ("row", "short") for kind in ("json", "png", "tar")]


def test_files_hold_the_kit_of_its_shapes(made: tuple[Path, Config]) -> None:
    folder, config = made
    root = folder / "out" / ".work" / "toy" / "exemplars"
    settings = config.section(ExemplarsConfig).kits[0]
    kit, _ = build_kit(settings, [read_parts(shape.path) for shape in settings.shapes])
    assert kit_json(load_kit(root / "row.json", root / "row.tar")) == kit_json(kit)
    assert kit.grammar.neighbourhoods == {0: {((0, 1),): 4, ((0, 2),): 4}}


def test_record_holds_counts_and_warnings(made: tuple[Path, Config]) -> None:
    summary = record(made[0], "row")["summary"]
    assert summary["parts"] == [3, 5]
    assert (summary["types"], summary["rules"], summary["dockings"]) == (1, 2, 1)
    assert summary["contacts"] == {"point": 0, "line": 0, "face": 6}
    assert summary["segmentation"][0] == "short.obj: objects: 3 named objects"
    assert summary["warnings"] == []


def test_status_has_a_line_per_kit(made: tuple[Path, Config]) -> None:
    folder, config = made
    lines = "\n".join(status_lines(config, STAGES, DatasetPaths(folder / "out", "toy"), 1))
    assert "row: 3 + 5 parts of 1 types, 2 neighbourhoods, 1 dockings" in lines


def test_figure_is_not_blank(made: tuple[Path, Config]) -> None:
    with Image.open(made[0] / "out" / ".work" / "toy" / "exemplars" / "row.png") as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape[1] > 1000
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 500


def test_another_run_gives_the_same_bytes(made: tuple[Path, Config]) -> None:
    folder, config = made
    assert run(folder, config, "again") == ()
    assert files(folder, "again") == files(folder)


def test_changed_model_rebuilds_its_kit_only(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_obj(tmp_path / f"{name}.obj", blocks(3))
    config = write_config(
        tmp_path, [{"name": name, "shapes": [str(tmp_path / f"{name}.obj")]} for name in ("one", "two")]
    )
    assert run(tmp_path, config) == ()
    before = {name: record(tmp_path, name)["fingerprint"] for name in ("one", "two")}
    write_obj(tmp_path / "one.obj", blocks(4))
    assert run(tmp_path, config) == ()
    assert record(tmp_path, "one")["summary"]["parts"] == [4]
    assert record(tmp_path, "one")["fingerprint"] != before["one"]
    assert record(tmp_path, "two")["fingerprint"] == before["two"]


def test_impossible_kit_fails_with_the_mend_and_the_rest_is_built(tmp_path: Path) -> None:
    write_obj(tmp_path / "good.obj", blocks(3))
    write_obj(tmp_path / "apart.obj", blocks(3, gap=0.5))
    config = write_config(
        tmp_path, [{"name": name, "shapes": [str(tmp_path / f"{name}.obj")]} for name in ("apart", "good")]
    )
    assert run(tmp_path, config) == ("apart",)
    assert "good.json" in files(tmp_path)
    assert "apart.json" not in files(tmp_path)
    failed = tmp_path / "out" / ".work" / "toy" / "exemplars" / "failed"
    assert "falls into 3 pieces" in "".join(path.read_text(encoding="utf-8") for path in failed.iterdir())


def test_config_with_a_missing_file_starts_nothing(tmp_path: Path) -> None:
    write_obj(tmp_path / "here.obj", blocks(2))
    with pytest.raises(ConfigError, match=r"there is no file .*her\.obj; the nearest file there is .*here\.obj"):
        write_config(tmp_path, [{"name": "kit", "shapes": [str(tmp_path / "her.obj")]}])


def test_two_kits_of_one_name_start_nothing(tmp_path: Path) -> None:
    path = str(write_obj(tmp_path / "here.obj", blocks(2)))
    with pytest.raises(ConfigError, match="two kits are named 'kit'"):
        write_config(tmp_path, [{"name": "kit", "shapes": [path]}] * 2)
