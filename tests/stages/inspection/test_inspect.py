"""`make inspect`: what it prints, what it writes, and which mistakes it names."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from PIL import Image

from pipeline.cli import main as shapemill
from tests.stages.exemplars.model_files import box, write_obj
from tests.stages.exemplars.test_appearance import textured_file


def inspect(*arguments: object) -> int:
    """Run `shapemill inspect` in this process and return its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["shapemill", "inspect", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            shapemill()
    return int(str(ended.value.code or 0))


def ring(folder: Path, name: str = "ring.obj") -> Path:
    """Write four cubes around a square."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    return write_obj(folder / name, {f"cube.{k:03d}": box(at=at) for k, at in enumerate(corners)})


WHOLE = ("--parts", "objects")
"""Nothing is searched for repetitions, which takes a single object three CPU seconds."""


RING_CONTACTS = "6 contacts (4 over a face, 2 along a line), in one piece"


def single(folder: Path, name: str = "one.obj") -> Path:
    """Write one cube: a run refuses it, so that no new shapes are drawn, which takes seconds."""
    return write_obj(folder / name, {"only": box()})


def inspected(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    """Return what `--json` prints after a short search: one object on one line, and nothing else."""
    assert inspect(*arguments, "--json", "--tries", "100") == 0
    printed = capsys.readouterr()
    assert [line for line in printed.err.splitlines() if "compiling kernels" not in line] == []
    assert printed.out.count("\n") == 1
    result: dict[str, Any] = json.loads(printed.out)
    return result


class TestJson:
    def test_one_model_has_parts_and_contacts_at_the_top(self, tmp_path: Path, capsys: Any) -> None:
        result = inspected(capsys, ring(tmp_path))
        assert result["parts"] == [{"name": f"cube.{k:03d}", "type": "cube"} for k in range(4)]
        assert result["contacts"] == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
        assert [kind for _, _, kind in result["contact_kinds"]] == ["face", "line", "face", "face", "line", "face"]
        assert result["types"] == [{"name": "cube", "count": 4, "triangles": 12, "symmetries": 24}]
        seen, *follow_from_rows = result["neighbourhoods"]["cube"]
        assert seen == {"neighbours": {"cube": 3}, "seen": 4}
        assert {rule["seen"] for rule in follow_from_rows} == {0}
        assert [docking["kind"] for docking in result["dockings"]] == ["face", "line"]
        assert result["segmentation"] == {"parts": "objects", "why": "4 named objects"}
        assert result["pieces"] == [[0, 1, 2, 3]]
        assert result["tolerance"] == pytest.approx(1e-3 * np.sqrt(3))
        assert (result["repairs"], result["hubs"], result["warnings"], result["mirror_twins"]) == ({}, [], [], [])

    def test_several_models_are_listed_and_share_their_types(self, tmp_path: Path, capsys: Any) -> None:
        row = write_obj(tmp_path / "row.obj", {"a": box(), "b": box(at=(1, 0, 0)), "c": box((1, 1, 2), (2, 0, 0))})
        result = inspected(capsys, ring(tmp_path), row)
        assert "parts" not in result
        assert [model["model"] for model in result["models"]] == [str(tmp_path / "ring.obj"), str(row)]
        assert [part["type"] for part in result["models"][1]["parts"]] == ["cube", "cube", "c"]
        assert result["models"][1]["contacts"] == [[0, 1], [1, 2]]
        assert [(kind["name"], kind["count"]) for kind in result["types"]] == [("cube", 6), ("c", 1)]

    def test_only_stated_kinds_of_contact_count(self, tmp_path: Path, capsys: Any) -> None:
        result = inspected(capsys, ring(tmp_path), "--kinds", "face")
        assert result["contacts"] == [[0, 1], [0, 3], [1, 2], [2, 3]]
        assert len(result["contact_kinds"]) == 6

    def test_tolerance_is_a_share_of_the_median_part(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "gap.obj", {"a": box(), "b": box(at=(1.02, 0, 0))})
        assert inspected(capsys, path, "--tolerance", "0.001")["contacts"] == []
        assert inspected(capsys, path, "--tolerance", "0.02")["contacts"] == [[0, 1]]

    def test_parts_come_from_the_stated_source(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "all.obj", {"a": box(), "b": box(at=(1, 0, 0))})
        path.write_text(path.read_text(encoding="utf-8").replace("o b", "# b"), encoding="utf-8")
        result = inspected(capsys, path, "--parts", "components")
        assert [part["name"] for part in result["parts"]] == ["component-000", "component-001"]
        assert result["segmentation"]["parts"] == "components"

    def test_labels_distinguish_congruent_parts(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(
            tmp_path / "named.obj", {"post.1": box(), "post.2": box(at=(1, 0, 0)), "cap": box(at=(2, 0, 0))}
        )
        assert len(inspected(capsys, path)["types"]) == 1
        assert [kind["count"] for kind in inspected(capsys, path, "--types", "labels")["types"]] == [2, 1]

    def test_stated_labels_make_types_and_are_written_to_the_config(self, tmp_path: Path, capsys: Any) -> None:
        # the last cube is apart: a run refuses the model, so that no new shapes are drawn
        cubes = {f"cube.{k:03d}": box(at=(x, 0, 0)) for k, x in enumerate((0, 1, 2, 4))}
        labels = ("--types", "meaning", "--label", "post=cube.00[0-2]", "--label", "cap=*.003")
        options = (*labels, "--tolerance", "0.001", "--out", tmp_path)
        result = inspected(capsys, write_obj(tmp_path / "row.obj", cubes), *options)
        assert [(kind["name"], kind["count"]) for kind in result["types"]] == [("post", 3), ("cap", 1)]
        kit = yaml.safe_load(Path(result["files"]["config"]).read_text(encoding="utf-8"))["exemplars"]["kits"][0]
        assert kit["label_map"] == {"post": ["cube.00[0-2]"], "cap": ["*.003"]}

    def test_mirror_images_are_listed(self, tmp_path: Path, capsys: Any) -> None:
        skew = (
            box() + np.array([0.5, 0, 0]) * (box()[:, 1:2] > 0) * (box()[:, 2:] > 0) + [0, 0, 0.3] * (box()[:, :1] > 0)
        )
        path = write_obj(tmp_path / "pair.obj", {"left": skew, "right": skew * [-1, 1, 1]})
        assert inspected(capsys, path)["mirror_twins"] == [["left", "right"]]

    def test_hubs_are_listed(self, tmp_path: Path, capsys: Any) -> None:
        posts = {f"post.{k:03d}": box((0.5, 1, 1), (k, 0, 0)) for k in range(14)}
        result = inspected(capsys, write_obj(tmp_path / "hub.obj", {"floor": box((14, 1, 1), (0, 0, -1)), **posts}))
        assert result["hubs"] == [{"part": 0, "name": "floor", "contacts": 14}]
        assert any("floor (14)" in warning for warning in result["warnings"])


class TestRefusedModels:
    def test_single_part_is_shown_with_a_warning(self, tmp_path: Path, capsys: Any) -> None:
        result = inspected(capsys, single(tmp_path))
        assert (result["parts"], result["contacts"]) == ([{"name": "only", "type": "only"}], [])
        assert "needs at least 2" in result["warnings"][0]

    def test_pieces_are_shown_with_the_tolerance_that_joins_them(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "gap.obj", {"a": box(), "b": box(at=(1, 0, 0)), "c": box(at=(2.01, 0, 0))})
        result = inspected(capsys, path, "--tolerance", "0.001")
        assert result["pieces"] == [[0, 1], [2]]
        assert "2 pieces of 2, 1 parts (apart: c); set `contact.tolerance: 0.01`" in result["warnings"][0]

    def test_models_without_a_common_type_are_shown_with_a_warning(self, tmp_path: Path, capsys: Any) -> None:
        slabs = {name: box((1, 1, 2), at) for name, at in (("a", (0, 0, 0)), ("b", (1, 0, 0)))}
        result = inspected(capsys, ring(tmp_path), write_obj(tmp_path / "slabs.obj", slabs))
        assert sum("shares no part type" in warning for warning in result["warnings"]) == 2

    def test_part_without_area_is_left_out_and_named(self, tmp_path: Path, capsys: Any) -> None:
        flat = box() * [1, 0, 0]
        result = inspected(capsys, write_obj(tmp_path / "flat.obj", {"a": box(), "line": flat, "b": box(at=(1, 0, 0))}))
        assert [part["name"] for part in result["parts"]] == ["a", "b"]
        assert result["contacts"] == [[0, 1]]
        assert "line (it has no triangle with area)" in result["warnings"][0]

    def test_model_without_repeats_gets_a_warning(self, tmp_path: Path, capsys: Any) -> None:
        result = inspected(capsys, write_obj(tmp_path / "ab.obj", {"a": box(), "b": box((1, 1, 2), (1, 0, 0))}))
        assert "nothing can be exchanged" in result["warnings"][0]


class TestText:
    def test_text_has_a_table_and_files_go_to_the_default_folder(
        self, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path, out = ring(tmp_path), Path("datasets/inspect")
        monkeypatch.chdir(tmp_path)
        assert inspect(path, "--up", "z", "--tries", "100") == 0
        printed = capsys.readouterr()
        lines = printed.out.splitlines()
        first = [f"inspect: {fact}" for fact in ("1 part type: 4 cube", RING_CONTACTS, "z points up, as stated")]
        assert [line for line in printed.err.splitlines() if line in first] == first
        assert lines[0] == str(tmp_path / "ring.obj")
        text = "\n".join(" ".join(line.split()) for line in lines)
        assert "parts 4 by objects (4 named objects)" in text
        assert "contacts 6: 4 over a face, 2 along a line" in text
        assert "connected yes" in text
        assert "cube 4 12 24" in text
        assert "grammar 3 neighbourhoods, 2 dockings of 1 part types" in text
        assert f"picture {out / 'ring.png'}" in text
        assert text.endswith(f"config {out / 'ring.yaml'}")
        with Image.open(out / "ring.png") as image:
            assert min(image.size) > 400

    def test_several_models_have_separate_columns(self, tmp_path: Path, capsys: Any) -> None:
        both = f"{single(tmp_path)} {single(tmp_path, 'again.obj')}"  # as in MESH="one.obj again.obj"
        assert inspect(both, "--out", tmp_path / "out", "--tries", "100", *WHOLE) == 0
        printed = capsys.readouterr()
        for path in both.split():
            assert f"inspect: {path}: 0 contacts, in one piece\n" in printed.err
        text = " ".join(printed.out.split())
        assert "type in 1 in 2 triangles symmetries only 1 1 12 24" in text


class TestWrongInput:
    def test_missing_file_is_named_with_the_nearest(self, tmp_path: Path, capsys: Any) -> None:
        ring(tmp_path)
        assert inspect(tmp_path / "rin.obj", "--json") == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert "no such file; did you mean ring.obj?" in printed.err

    def test_broken_file_is_named(self, tmp_path: Path, capsys: Any) -> None:
        (tmp_path / "cut.glb").write_bytes(b"glTF\x02\0\0\0")
        assert inspect(tmp_path / "cut.glb") == 2
        assert "cut.glb" in capsys.readouterr().err

    def test_tolerance_out_of_range_is_refused(self, tmp_path: Path, capsys: Any) -> None:
        assert inspect(ring(tmp_path), "--tolerance", "3") == 2
        assert "--tolerance" in capsys.readouterr().err

    def test_unwritable_output_folder_is_refused(self, tmp_path: Path, capsys: Any) -> None:
        path = single(tmp_path)
        assert inspect(path, "--out", path, "--tries", "100", *WHOLE) == 2
        assert "cannot be written" in capsys.readouterr().err

    @pytest.mark.parametrize(
        "arguments", [["--kinds", "edge"], ["--parts", "things"], ["--types", "x"], ["--label", "x"], []]
    )
    def test_wrong_option_shows_the_usage(self, arguments: list[str], tmp_path: Path, capsys: Any) -> None:
        models = [str(ring(tmp_path))] if arguments else []
        assert inspect(*models, *arguments) == 2
        assert "Usage: shapemill inspect" in capsys.readouterr().err


def test_command_prints_one_json_object_and_nothing_else(tmp_path: Path) -> None:
    path = single(tmp_path)
    out = tmp_path / "out"
    options = ["--json", "--tries", "100", "--out", str(out), *WHOLE]
    command = [sys.executable, "-m", "pipeline", "inspect", str(path), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["files"]["picture"] == str(out / "one.png")
    assert (out / "one.png").stat().st_size > 10_000


def test_table_has_a_row_for_every_readable_model(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "cut.glb").write_bytes(b"glTF\x02\0\0\0")
    assert inspect(ring(tmp_path), tmp_path / "cut.glb", "--table", "--tries", 100) == 0
    printed = capsys.readouterr()
    header, _, row = printed.out.splitlines()
    assert header.startswith("| model | parts | types | up |")
    assert row.startswith("| ring | 4 | 1 |")
    assert "cut.glb" in printed.err


@pytest.mark.parametrize("textured", [True, False])
def test_written_config_keeps_textures_that_the_models_have(textured: bool, tmp_path: Path, capsys: Any) -> None:
    path = single(tmp_path)
    if textured:
        scene = trimesh.load_scene(textured_file(tmp_path / "bricks.glb"))
        scene.delete_geometry("brick1")
        path = tmp_path / "one.glb"
        scene.export(path)
    parts = ("--parts", "nodes") if textured else WHOLE
    result = inspected(capsys, path, "--out", tmp_path / "report", *parts)
    written = yaml.safe_load((tmp_path / "report/one.yaml").read_text(encoding="utf-8"))
    assert written["exemplars"]["kits"][0].get("appearance") == ("textures" if textured else None)
    assert not any("read as opaque colours" in warning for warning in result["warnings"])
