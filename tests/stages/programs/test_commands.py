"""`shapemill programs`: the files it writes, and its messages for mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from stages.programs.program import build_shape
from stages.programs.sheets import CELL_SIDE_PIXELS, values_showing
from stages.recovery.result import RecoveryResult
from stages.shape.views.palette import PAPER
from tests.command import shapemill
from tests.stages.programs.stool import PROGRAM

BLOCK, STOOL = "tests.stages.programs.block", "tests.stages.programs.stool"


def programs(*arguments: object) -> str:
    """What `shapemill programs` prints with these arguments; it must succeed."""
    code, printed = shapemill("programs", *arguments)
    assert code == 0, printed
    return printed


def test_mix_writes_the_mixed_shape_its_sources_and_a_sheet(tmp_path: Path) -> None:
    programs("mix", STOOL, "1", "base", "--group", "rail", "--out", tmp_path)
    names = ("target", "source", "mixed")
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in names for kind in ("glb", "json")
    } | {"sheet.png"}
    target, source, mixed = (
        PROGRAM.schema.from_text((tmp_path / f"{name}.json").read_text(encoding="utf-8")) for name in names
    )
    assert source == PROGRAM.schema.base
    assert mixed["rail_height"] == source["rail_height"]
    assert mixed["scale x"] == target["scale x"]


def test_glb_has_named_parts_at_their_poses(tmp_path: Path) -> None:
    programs("make", STOOL, "base", "--out", tmp_path)
    scene = trimesh.load_scene(tmp_path / "base.glb")
    shape = build_shape(PROGRAM, PROGRAM.schema.base)
    assert set(scene.graph.nodes_geometry) == {"seat.000", "leg.000", "leg.001", "rail.000"}
    for name, mesh, pose in zip(shape.part_names, shape.meshes, shape.assembly.poses, strict=True):
        placed, geometry = scene.graph.get(name)
        assert geometry == name
        np.testing.assert_allclose(placed, pose, atol=1e-6)
        np.testing.assert_allclose(scene.geometry[name].bounds, mesh.bounds, atol=1e-6)
        assert len(scene.geometry[name].faces) == len(mesh.faces)


def test_interpolation_writes_even_steps(tmp_path: Path) -> None:
    ends = [tmp_path / "a.json", tmp_path / "b.json"]
    for path, height in zip(ends, (0.4, 0.8), strict=True):
        path.write_text(PROGRAM.schema.to_text({**PROGRAM.schema.base, "height": height}), encoding="utf-8")
    out = tmp_path / "steps"
    programs("interpolate", STOOL, *ends, "--steps", "3", "--out", out)
    heights = [
        json.loads((out / f"step-{number:02d}.json").read_text(encoding="utf-8"))["height"] for number in range(3)
    ]
    assert heights == pytest.approx([0.4, 0.6, 0.8])


def test_files_of_recovery_can_be_edited(tmp_path: Path) -> None:
    low, high = ({**PROGRAM.schema.base, "height": height} for height in (0.4, 0.8))
    for name, values in (("low", low), ("high", high)):
        result = RecoveryResult(PROGRAM, values, 0.001, 0.1, 0.0, None, None, None, "y", 1, ())
        (tmp_path / f"{name}.json").write_text(json.dumps({"input": name, **result.as_json()}), encoding="utf-8")
    ends = [str(tmp_path / f"{name}.json") for name in ("low", "high")]
    programs("interpolate", STOOL, *ends, "--steps", "3", "--group", "seat", "--out", tmp_path / "steps")
    assert PROGRAM.schema.from_text((tmp_path / "steps/step-01.json").read_text(encoding="utf-8"))[
        "height"
    ] == pytest.approx(0.6)
    programs("mix", STOOL, *ends, "--group", "seat", "--out", tmp_path / "mix")
    assert PROGRAM.schema.from_text((tmp_path / "mix/mixed.json").read_text(encoding="utf-8"))["height"] == 0.8
    code, printed = shapemill("programs", "make", "chair", ends[0], "--out", tmp_path)
    assert code == 2
    assert "low.json: these are parameters of 'stool', not of chair" in printed


def test_inspect_prints_the_table_and_draws_a_row_per_parameter(tmp_path: Path) -> None:
    printed = programs("inspect", BLOCK, "--out", tmp_path)
    assert "| `height` | continuous | 1 to 2 (3 values) |" in printed
    sheet = np.asarray(Image.open(tmp_path / "block.png")).astype(int)
    # The third and last picture of the second row: the highest block fills the frame, with nothing to its right.
    assert sheet.shape[1] > 3 * CELL_SIDE_PIXELS
    inked = np.abs(sheet - PAPER).sum(axis=2) > 150
    assert inked[-CELL_SIDE_PIXELS:, 2 * CELL_SIDE_PIXELS : 3 * CELL_SIDE_PIXELS].any()
    assert not inked[-CELL_SIDE_PIXELS:, 3 * CELL_SIDE_PIXELS + 100 :].any()


def test_sheets_of_one_seed_are_equal(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        programs("sheet", BLOCK, "--count", "2", "--seed", "4", "--picture", tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["make", "chiar", "base"], "there is no program 'chiar'"),
        (["make", STOOL, "nowhere.json"], "nowhere.json: No such file or directory; give a JSON file"),
        (["make", STOOL, "{folder}/high.json"], "high.json: parameter height: 9 is out of range; it may be 0.3 to 1.0"),
        (["make", STOOL, "{folder}/hung.json"], "hung.json: a stool needs height >= rail_height: A rail above"),
        (["mix", STOOL, "base", "base", "--group", "legs"], "there is no group 'legs'; groups are seat, rail"),
    ],
)
def test_mistakes_are_reported_with_a_remedy(arguments: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "high.json").write_text('{"height": 9}', encoding="utf-8")
    hung = '{"height": 0.3, "scale x": 0.5, "has_rail": true, "rail_height": 0.6}'
    (tmp_path / "hung.json").write_text(hung, encoding="utf-8")
    given = [argument.replace("{folder}", str(tmp_path)) for argument in arguments]
    code, printed = shapemill("programs", *given, "--out", tmp_path / "out")
    assert code == 2
    assert message in printed
    assert not (tmp_path / "out").exists()


def test_hidden_parameter_is_shown_by_few_changes() -> None:
    assert values_showing(PROGRAM, PROGRAM.parameters[0]) == PROGRAM.schema.base
    assert values_showing(PROGRAM, PROGRAM.parameters[3]) == PROGRAM.schema.base
