"""A config is filled with models of a folder, and a few models become many shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from pipeline.errors import ConfigError
from stages.inspection.models_config import config_with_models, models_of
from stages.package.reader import Dataset
from tests.command import shapemill

FEW_SHOT = Path(__file__).resolve().parents[3] / "configs" / "few-shot.yaml"


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three racks: two posts and two, three or four shelves between them."""
    folder = tmp_path_factory.mktemp("racks")
    for shelves in (2, 3, 4):
        scene = trimesh.Scene()
        for side in (-1.05, 1.05):
            post = trimesh.creation.box((0.1, 2.2, 1.0))
            post.apply_translation((side, 1.1, 0.0))
            scene.add_geometry(post, node_name=f"post.{side}", geom_name=f"post{side}")
        for shelf in range(shelves):
            board = trimesh.creation.box((2.0, 0.1, 1.0))
            board.apply_translation((0.0, 0.3 + 0.4 * shelf, 0.0))
            scene.add_geometry(board, node_name=f"shelf.{shelf}", geom_name=f"shelf{shelf}")
        scene.export(folder / f"rack{shelves}.glb")
    (folder / "notes.txt").write_text("no model", encoding="utf-8")
    return folder


def test_models_take_the_place_of_the_kits_and_all_else_stays(models: Path, tmp_path: Path) -> None:
    config = tmp_path / "two.yaml"
    text = "name: two\nseed: 7\nexemplars:\n  kits: [{name: a, shapes: [a.glb]}]\n  limits: {parts: 99}\n"
    config.write_text(text, encoding="utf-8")
    name, content, warnings = config_with_models(config, [models])
    values = yaml.safe_load(content)
    assert name == values["name"] == f"two-{models.name}"
    assert values["seed"] == 7
    assert values["exemplars"]["limits"] == {"parts": 99}
    (kit,) = values["exemplars"]["kits"]
    assert "appearance" not in kit
    assert kit["shapes"] == [str(models / f"rack{shelves}.glb") for shelves in (2, 3, 4)]
    assert kit["name"] == models.name
    assert warnings == []


def test_textures_stay_asked_for(models: Path) -> None:
    _, content, _ = config_with_models(FEW_SHOT, [models])
    (kit,) = yaml.safe_load(content)["exemplars"]["kits"]
    assert kit["appearance"] == "textures"


def write_pair(path: Path, side: float) -> Path:
    """Two equal cubes, one on the other."""
    scene = trimesh.Scene()
    for height in (0.5, 1.5):
        cube = trimesh.creation.box((side, side, side))
        cube.apply_translation((0.0, height * side, 0.0))
        scene.add_geometry(cube, node_name=f"cube.{height}", geom_name=f"cube{height}")
    scene.export(path)
    return path


def test_models_without_a_type_in_common_are_kits_of_their_own(models: Path, tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
    small, large = write_pair(tmp_path / "one" / "pair.glb", 1.0), write_pair(tmp_path / "two" / "pair.glb", 3.0)
    racks = [models / f"rack{shelves}.glb" for shelves in (2, 3, 4)]
    _, content, warnings = config_with_models(FEW_SHOT, [racks[0], small, *racks[1:], large])
    kits = {kit["name"]: kit["shapes"] for kit in yaml.safe_load(content)["exemplars"]["kits"]}
    assert kits == {"rack2": [str(rack) for rack in racks], "pair": [str(small)], "pair-2": [str(large)]}
    assert warnings == []


def test_models_without_use_are_left_out_and_named(models: Path, tmp_path: Path) -> None:
    trimesh.creation.icosphere(1).export(tmp_path / "ball.stl")
    (tmp_path / "broken.glb").write_bytes(b"no model")
    kept = write_pair(tmp_path / "pair.glb", 1.0)
    _, content, warnings = config_with_models(FEW_SHOT, [tmp_path])
    (kit,) = yaml.safe_load(content)["exemplars"]["kits"]
    assert kit["shapes"] == [str(kept)]
    ball, broken = warnings
    assert ball.startswith(f"left out: {tmp_path / 'ball.stl'}: has 1 part")
    assert broken.startswith(f"left out: {tmp_path / 'broken.glb'}: ")
    kept.unlink()
    with pytest.raises(ConfigError, match=r"(?s)ball\.stl: has 1 part.*broken\.glb"):
        config_with_models(FEW_SHOT, [tmp_path])


def test_missing_path_and_folder_without_models_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"there is no file or folder .*absent"):
        models_of([tmp_path / "absent"])
    with pytest.raises(ConfigError, match=r"holds no models; name a folder with files in \.glb"):
        models_of([tmp_path])


@pytest.mark.slow
def test_three_models_become_shapes_with_other_rows_and_proportions(models: Path, tmp_path: Path) -> None:
    values = yaml.safe_load(FEW_SHOT.read_text(encoding="utf-8"))
    values |= {"strings": False, "points": {"uniform": 64}, "autoconfig": {"max_tries": 200}}
    values["variations"]["samples_per_kit"] = values["proportions"]["samples_per_kit"] = 12
    config = tmp_path / "few.yaml"
    config.write_text(yaml.safe_dump(values), encoding="utf-8")
    out = tmp_path / "out"

    code, printed = shapemill("with-models", "--config", config, "--out", out, "--", models)
    assert code == 0, printed
    written = Path(printed.splitlines()[-1])
    assert written.parent == out
    code, printed = shapemill("run", "--config", written, "--out", out, "--workers", 1)
    assert code == 0, printed

    dataset = Dataset.open(out / written.stem)
    samples = list(dataset)
    assert len(samples) == 12
    assert all(sample.record["producer"] == "proportions" for sample in samples), "posts hold the rows of shelves"
    shelves = [sum(part["label"] == "shelf" for part in sample.record["parts"]) for sample in samples]
    assert not set(shelves) <= {2, 3, 4}, "rows become longer and shorter than those of the models"
    sizes = {tuple(np.round(np.ptp(sample.points, axis=0), 2)) for sample in samples}
    assert len(sizes) == 12
