"""Recovery of stools: the search alone, with a network, and as a command."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from safetensors.torch import save

from pipeline.errors import ConfigError
from stages.points.area_sampling import sample_surface
from stages.programs.curves.part import joined
from stages.programs.program import find_program
from stages.programs.schema import Values
from stages.recovery.cloud_target import cloud_target
from stages.recovery.inputs import InputError, RecoveryInput
from stages.recovery.reading import read_inputs
from stages.recovery.recover import recover, recover_input
from stages.recovery.refinement import refine_estimate
from stages.shape.geometry.clouds import chamfer_squared
from stages.sketches.settings import SketchesConfig, SketchView
from stages.training.checkpoint import CheckpointError, checkpoint_bytes
from stages.training.recovery.drawings import draw_fitted
from stages.training.recovery.estimate import base_estimate
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.shapes import TEST_INTERVAL, TRAIN_INTERVAL, VALIDATION_INTERVAL, random_training_shapes
from stages.training.recovery.surface import shape_points
from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models, load_recovery
from stages.training.recovery.training import new_network, parameter_descriptions
from stages.training.ship import slim_bytes
from tests.command import shapemill
from tests.stages.training.recovery.toy import PROGRAM, SMALL, config, train

STOOL = find_program(PROGRAM)
TALL: Values = {"height": 0.9, "scale x": 0.7, "has_rail": True, "rail_height": 0.2}


def cloud_of(values: Values, n: int = 2000, seed: int = 0) -> np.ndarray:
    mesh = joined(STOOL.parts(values)).mesh
    return sample_surface(mesh.vertices, mesh.triangles, n, np.random.default_rng(seed))[0]


def off_by(values: Values, truth: Values) -> float:
    return max(abs(float(values[name]) - float(truth[name])) for name in truth)


def test_intervals_share_no_shape() -> None:
    texts = [
        {
            STOOL.schema.to_text(shape.values)
            for shape in islice(random_training_shapes(STOOL, interval, np.random.default_rng(0)), 60)
        }
        for interval in (TRAIN_INTERVAL, VALIDATION_INTERVAL, TEST_INTERVAL)
    ]
    assert not texts[0] & texts[1]
    assert not texts[0] & texts[2]
    assert not texts[1] & texts[2]


def test_random_shapes_are_valid_with_hidden_classes() -> None:
    for shape in islice(random_training_shapes(STOOL, TRAIN_INTERVAL, np.random.default_rng(1)), 40):
        assert not STOOL.violated(shape.values)
        assert (shape.classes[3] == 6) == (not shape.values["has_rail"])


def test_search_without_a_network_finds_a_stool() -> None:
    rng = np.random.default_rng(0)
    found = refine_estimate(STOOL, base_estimate(STOOL), cloud_target(cloud_of(TALL), rng), 300, rng)
    assert found.tried <= 302
    assert off_by(found.values, TALL) < 0.03
    first = refine_estimate(STOOL, base_estimate(STOOL), cloud_target(cloud_of(TALL), rng), 1, rng)
    assert found.distance < 0.25 * first.distance


@pytest.mark.parametrize("budget", [1, 20, 60])
def test_larger_budget_is_never_worse(budget: int) -> None:
    def distance(shapes: int) -> float:
        rng = np.random.default_rng(0)
        return refine_estimate(STOOL, base_estimate(STOOL), cloud_target(cloud_of(TALL), rng), shapes, rng).distance

    assert distance(4 * budget) <= distance(budget)


@pytest.mark.parametrize("up", ["y", "z", "x"])
@pytest.mark.parametrize("up_is_given", [True, False])
def test_clouds_of_any_position_size_and_axis_are_recovered(up: str, up_is_given: bool) -> None:
    cloud = cloud_of(TALL, n=700) * 40 + [5, -300, 2]
    turned = cloud[:, {"y": [0, 1, 2], "z": [2, 0, 1], "x": [1, 2, 0]}[up]]
    found = recover(turned, PROGRAM, up=up if up_is_given else "", budget=200)  # type: ignore[arg-type]
    assert found.up == up
    assert off_by(found.values, TALL) < 0.06
    assert found.placement is not None
    there = shape_points(STOOL.parts(found.values), 2000) @ found.placement[:3, :3].T + found.placement[:3, 3]
    # the cloud is forty times as large as the stool
    assert chamfer_squared(there, turned) < 0.004 * 40**2
    assert np.linalg.det(found.placement[:3, :3]) > 0
    assert any("no trained model" in warning for warning in found.warnings)


@pytest.mark.parametrize(("azimuth", "elevation"), [(-30.0, 20.0), (8.0, 15.0), (-50.0, 50.0)])
def test_camera_of_a_drawing_is_found(azimuth: float, elevation: float) -> None:
    view = SketchView(azimuth=azimuth, elevation=elevation)
    ink = draw_fitted(STOOL, tuple(STOOL.parts(TALL)), view, SketchesConfig(), np.random.default_rng(0))
    found = recover_input(RecoveryInput("stool", ink=ink), PROGRAM, {}, "y", 60, 0)
    assert found.placement is None
    assert found.camera is not None
    assert found.camera.azimuth == pytest.approx(azimuth, abs=12.0)
    assert found.camera.elevation == pytest.approx(elevation, abs=12.0)
    assert found.as_json()["camera"]["azimuth"] == found.camera.azimuth
    camera_of_cloud = recover(cloud_of(TALL, n=300), PROGRAM, up="y", budget=1).as_json()["camera"]
    assert camera_of_cloud is None


def test_recovery_is_deterministic() -> None:
    cloud = cloud_of(TALL, n=300)
    assert recover(cloud, PROGRAM, budget=80).as_json() == recover(cloud, PROGRAM, budget=80).as_json()


def test_unlike_input_is_reported() -> None:
    ball = np.random.default_rng(0).normal(size=(500, 3))
    found = recover(ball / np.linalg.norm(ball, axis=1, keepdims=True), PROGRAM, up="y", budget=20)
    assert any("unlike any stool" in warning for warning in found.warnings)


def test_unknown_program_is_reported() -> None:
    with pytest.raises(ConfigError, match="did you mean chair"):
        recover(cloud_of(TALL), "chari")


def test_program_is_found_by_fit() -> None:
    vase = find_program("vase")
    cloud = shape_points(vase.parts(vase.schema.base), 1500)
    found = recover(cloud, budget=1, up="y")
    assert found.program.name == "vase"
    assert any("no program was named" in warning for warning in found.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["points", "sketch"])
def test_command_uses_the_trained_model(kind: str, tmp_path: Path) -> None:
    train(config(input=kind, max_rounds=1), tmp_path)
    models, problems = find_models(tmp_path)
    assert list(models) == [(PROGRAM, kind)]
    assert not problems
    if kind == "points":
        trimesh.PointCloud(cloud_of(TALL)).export(tmp_path / "mine.ply")
        given = tmp_path / "mine.ply"
    else:
        from PIL import Image

        model = models[PROGRAM, kind]
        rng = np.random.default_rng(0)
        ink = draw_fitted(STOOL, tuple(STOOL.parts(TALL)), model.sketches.views[0], model.sketches, rng)
        given = tmp_path / "mine.png"
        Image.fromarray(np.where(ink, 0, 255).astype(np.uint8)).save(given)
    code, printed = shapemill("recover", given, "--program", PROGRAM, "--out", tmp_path, "--budget", 40)
    assert code == 0, printed
    described = json.loads((tmp_path / "recovered/mine.json").read_text(encoding="utf-8"))
    assert set(described["confidence"]) == set(described["parameters"])
    assert all(0.0 <= probability <= 1.0 for probability in described["confidence"].values())
    assert off_by(STOOL.schema.from_text(json.dumps(described["parameters"])), STOOL.schema.base) > 0.0
    assert described["chamfer"] < described["chamfer_of_base"]
    assert trimesh.load_scene(tmp_path / "recovered/mine.glb").geometry
    assert (tmp_path / "recovered/mine.png").read_bytes().startswith(b"\x89PNG")
    assert "distance" in printed


def test_unusable_models_are_reported_and_skipped(tmp_path: Path) -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "widths": (8, 8)}, strict=False)
    tensors = new_network(entry, STOOL, 0).state_dict()
    settings = {name: value for name, value in SMALL.items() if name != "name"}
    good = {
        "kind": "recovery",
        "program": PROGRAM,
        "parameters": parameter_descriptions(STOOL),
        "settings": settings,
        "figures": {"val_loss": 2.0, "val_chamfer_p95": 0.1},
    }
    without = {name: value for name, value in good.items() if name != "program"}
    headers = {
        "good": good,
        "worse": {**good, "figures": {"val_loss": 3.0}},
        "moved": {**good, "program": "nowhere.at.all"},
        "nameless": without,
        "settings": {**good, "settings": {**settings, "points": -1}},
        "tensors": {**good, "settings": {**settings, "widths": [8, 9]}},
        "figures": {**good, "figures": {}},
    }
    for name, header in headers.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "weights.safetensors").write_bytes(checkpoint_bytes(tensors, header))
    (tmp_path / "list").mkdir()
    (tmp_path / "list/weights.safetensors").write_bytes(save({}, {"shapemill": "[]"}))
    models, problems = find_models(tmp_path)
    assert list(models) == [(PROGRAM, "points")]
    assert models[PROGRAM, "points"].header["figures"]["val_loss"] == 2.0
    assert [Path(text.split("/weights.safetensors")[0]).name for text in problems] == [
        "figures", "list", "moved", "nameless", "settings", "tensors",
    ]  # fmt: skip
    assert all(text.count("weights.safetensors") == 1 for text in problems)


def test_own_models_precede_shipped_ones_and_the_best_others(tmp_path: Path) -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "widths": (8, 8)}, strict=False)
    tensors = new_network(entry, STOOL, 0).state_dict()
    settings = {name: value for name, value in SMALL.items() if name != "name"}
    for folder, loss in (("own/toy-models/a", 3.0), ("own/toy-models/b", 2.5), ("shipped/a", 1.0)):
        header = {
            "kind": "recovery",
            "program": PROGRAM,
            "parameters": parameter_descriptions(STOOL),
            "settings": settings,
            "figures": {"val_loss": loss, "val_chamfer_p95": 0.1},
        }
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "weights.safetensors").write_bytes(checkpoint_bytes(tensors, header))
    for folders, best in ((("own", "shipped"), 2.5), (("nothing", "shipped"), 1.0)):
        models, problems = find_models(*(tmp_path / folder for folder in folders))
        assert not problems
        assert models[PROGRAM, "points"].header["figures"]["val_loss"] == best
    halved = tmp_path / "half.safetensors"
    halved.write_bytes(slim_bytes(tmp_path / "shipped/a/weights.safetensors"))
    assert halved.stat().st_size < 0.7 * (tmp_path / "shipped/a/weights.safetensors").stat().st_size
    for half, full in zip(
        load_recovery(halved).module.parameters(), new_network(entry, STOOL, 0).parameters(), strict=True
    ):
        np.testing.assert_allclose(half.detach(), full.detach(), atol=1e-3)


def test_large_weights_are_shipped_as_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "widths": (8, 8), "decoder": (64, 32)}, strict=False)
    tensors = new_network(entry, STOOL, 0).state_dict()
    settings = {**{name: value for name, value in SMALL.items() if name != "name"}, "decoder": [64, 32]}
    header = {"kind": "recovery", "program": PROGRAM, "parameters": parameter_descriptions(STOOL), "settings": settings}
    path, slim = tmp_path / "whole.safetensors", tmp_path / "slim.safetensors"
    path.write_bytes(checkpoint_bytes(tensors, header))
    halves = len(slim_bytes(path))
    monkeypatch.setattr("stages.training.ship.MAX_SHIPPED_BYTES", halves - 1000)
    slim.write_bytes(slim_bytes(path))
    assert slim.stat().st_size <= halves - 1000
    clouds = torch.rand(8, 64, 3, generator=torch.Generator().manual_seed(0))
    whole, slimmed = (load_recovery(file).module(clouds) for file in (path, slim))
    finite = torch.isfinite(whole)
    assert float((whole - slimmed)[finite].detach().abs().max()) < 0.02 * float(whole[finite].detach().abs().max())
    monkeypatch.setattr("stages.training.ship.MAX_SHIPPED_BYTES", 1000)
    with pytest.raises(CheckpointError, match="train a smaller model"):
        slim_bytes(path)


SHIPPED_MODELS, PROBLEMS = find_models(PRETRAINED_FOLDER)


def test_shipped_models_fit_the_programs() -> None:
    assert not PROBLEMS
    domains = ("cabinet", "ceiling_lamp", "chair", "table", "vase")
    assert sorted(SHIPPED_MODELS) == [(program, kind) for program in domains for kind in ("points", "sketch")]


@pytest.mark.parametrize(("program", "kind"), sorted(SHIPPED_MODELS))
def test_shipped_models_are_better_than_the_base_shape(program: str, kind: str) -> None:
    model = SHIPPED_MODELS[program, kind]
    made = find_program(program)
    shapes = list(islice(random_training_shapes(made, TEST_INTERVAL, np.random.default_rng(11)), 2))
    distances = []
    for shape in shapes:
        if kind == "points":
            source = shape_points(shape.parts, 2000)
        else:
            ink = draw_fitted(made, shape.parts, model.sketches.views[0], model.sketches, np.random.default_rng(0))
            source = np.where(ink, 0, 255).astype(np.uint8)
        found = recover(source, program, SHIPPED_MODELS, up="y", budget=20)
        distances.append((found.distance, found.base_distance))
    nearer, base = np.mean(distances, axis=0)
    assert nearer < 0.5 * base


def test_command_reports_mistakes_and_refused_inputs(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros((1, 3)))
    for arguments, code, message in (
        ([tmp_path / "none.ply"], 2, "no such file"),
        ([tmp_path, "--program", "chari"], 2, "did you mean chair"),
        ([tmp_path, "--program", PROGRAM], 1, "has 1 point"),
    ):
        exit_code, printed = shapemill("recover", *arguments, "--out", tmp_path)
        assert exit_code == code
        assert message in printed


def test_unreadable_files_do_not_stop_others(tmp_path: Path) -> None:
    (tmp_path / "list.gltf").write_text("[]", encoding="utf-8")
    (tmp_path / "garbled.npy").write_bytes(b"\x93NUMPY\x01\x00\x08\x00{'descr'")
    (tmp_path / "gone.ply").symlink_to(tmp_path / "nowhere.ply")
    (tmp_path / "folder.obj").mkdir()
    np.save(tmp_path / "good.npy", np.random.default_rng(0).random((100, 3)))
    np.savetxt(tmp_path / "good.xyz", np.random.default_rng(0).random((100, 3)))
    given = list(read_inputs(tmp_path))
    assert [source.name for source in given if isinstance(source, RecoveryInput)] == ["good.npy", "good.xyz"]
    assert len([source for source in given if isinstance(source, InputError)]) == 2


def test_base_estimate_of_a_lamp_is_its_base_shape() -> None:
    lamp = find_program("ceiling_lamp")
    assert base_estimate(lamp).values(lamp) == lamp.schema.base
