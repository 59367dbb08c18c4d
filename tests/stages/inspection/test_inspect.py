from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from stages.inspection.inspect import main
from tests.stages.exemplars.model_files import box, write_obj


def ring(folder: Path, name: str = "ring.obj") -> Path:
    """Four cubes around a square."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    return write_obj(folder / name, {f"cube.{k:03d}": box(at=at) for k, at in enumerate(corners)})


def seen(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    """What `--json` prints after a short probe: one object on one line, and nothing else."""
    assert main([*map(str, arguments), "--json", "--tries", "100"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out.count("\n") == 1
    found: dict[str, Any] = json.loads(printed.out)
    return found


class TestJson:
    def test_one_model_has_parts_and_contacts_at_the_top(self, tmp_path: Path, capsys: Any) -> None:
        found = seen(capsys, ring(tmp_path))
        assert found["parts"] == [{"name": f"cube.{k:03d}", "type": "cube"} for k in range(4)]
        assert found["contacts"] == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
        assert [kind for _, _, kind in found["contact_kinds"]] == ["face", "line", "face", "face", "line", "face"]
        assert found["types"] == [{"name": "cube", "count": 4, "triangles": 12, "symmetries": 24}]
        assert found["neighbourhoods"] == {"cube": [{"neighbours": {"cube": 3}, "seen": 4}]}
        assert [each["kind"] for each in found["dockings"]] == ["face", "line"]
        assert found["segmentation"] == {"parts": "objects", "why": "4 named objects"}
        assert found["pieces"] == [[0, 1, 2, 3]]
        assert found["tolerance"] == pytest.approx(1e-3 * np.sqrt(3))
        assert (found["repairs"], found["hubs"], found["warnings"], found["mirror_twins"]) == ({}, [], [], [])

    def test_several_models_are_listed_and_share_their_types(self, tmp_path: Path, capsys: Any) -> None:
        row = write_obj(tmp_path / "row.obj", {"a": box(), "b": box(at=(1, 0, 0)), "c": box((1, 1, 2), (2, 0, 0))})
        found = seen(capsys, ring(tmp_path), row)
        assert "parts" not in found
        assert [each["model"] for each in found["models"]] == [str(tmp_path / "ring.obj"), str(row)]
        assert [part["type"] for part in found["models"][1]["parts"]] == ["cube", "cube", "c"]
        assert found["models"][1]["contacts"] == [[0, 1], [1, 2]]
        assert [(each["name"], each["count"]) for each in found["types"]] == [("cube", 6), ("c", 1)]

    def test_only_kinds_that_were_asked_for_count(self, tmp_path: Path, capsys: Any) -> None:
        found = seen(capsys, ring(tmp_path), "--kinds", "face")
        assert found["contacts"] == [[0, 1], [0, 3], [1, 2], [2, 3]]
        assert len(found["contact_kinds"]) == 6

    def test_the_tolerance_is_a_share_of_the_median_part(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "gap.obj", {"a": box(), "b": box(at=(1.02, 0, 0))})
        assert seen(capsys, path, "--tolerance", "0.001")["contacts"] == []
        assert seen(capsys, path, "--tolerance", "0.02")["contacts"] == [[0, 1]]

    def test_parts_can_be_taken_from_elsewhere(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "all.obj", {"a": box(), "b": box(at=(1, 0, 0))})
        path.write_text(path.read_text().replace("o b", "# b"))
        found = seen(capsys, path, "--parts", "components")
        assert [part["name"] for part in found["parts"]] == ["component-000", "component-001"]
        assert found["segmentation"]["parts"] == "components"

    def test_labels_tell_congruent_parts_apart(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(
            tmp_path / "named.obj", {"post.1": box(), "post.2": box(at=(1, 0, 0)), "cap": box(at=(2, 0, 0))}
        )
        assert len(seen(capsys, path)["types"]) == 1
        assert [each["count"] for each in seen(capsys, path, "--types", "labels")["types"]] == [2, 1]

    def test_meanings_that_are_said_make_types_and_go_into_the_config(self, tmp_path: Path, capsys: Any) -> None:
        said = ("--types", "meaning", "--meaning", "post=cube.00[0-2]", "--meaning", "cap=*.003", "--out", tmp_path)
        found = seen(capsys, ring(tmp_path), *said)
        assert [(each["name"], each["count"]) for each in found["types"]] == [("post", 3), ("cap", 1)]
        kit = yaml.safe_load(Path(found["files"]["config"]).read_text())["exemplars"]["kits"][0]
        assert kit["label_map"] == {"post": ["cube.00[0-2]"], "cap": ["*.003"]}

    def test_mirror_images_are_pointed_out(self, tmp_path: Path, capsys: Any) -> None:
        skew = (
            box() + np.array([0.5, 0, 0]) * (box()[:, 1:2] > 0) * (box()[:, 2:] > 0) + [0, 0, 0.3] * (box()[:, :1] > 0)
        )
        path = write_obj(tmp_path / "pair.obj", {"left": skew, "right": skew * [-1, 1, 1]})
        assert seen(capsys, path)["mirror_twins"] == [["left", "right"]]

    def test_hubs_are_parts_of_the_answer(self, tmp_path: Path, capsys: Any) -> None:
        posts = {f"post.{k:03d}": box((0.5, 1, 1), (k, 0, 0)) for k in range(14)}
        found = seen(capsys, write_obj(tmp_path / "hub.obj", {"floor": box((14, 1, 1), (0, 0, -1)), **posts}))
        assert found["hubs"] == [{"part": 0, "name": "floor", "contacts": 14}]
        assert any("floor (14)" in warning for warning in found["warnings"])


class TestWhatARunRefuses:
    def test_one_part_alone_is_shown(self, tmp_path: Path, capsys: Any) -> None:
        found = seen(capsys, write_obj(tmp_path / "one.obj", {"only": box()}))
        assert (found["parts"], found["contacts"]) == ([{"name": "only", "type": "only"}], [])
        assert "needs at least 2" in found["warnings"][0]

    def test_pieces_are_shown_with_what_would_join_them(self, tmp_path: Path, capsys: Any) -> None:
        path = write_obj(tmp_path / "gap.obj", {"a": box(), "b": box(at=(1, 0, 0)), "c": box(at=(2.01, 0, 0))})
        found = seen(capsys, path, "--tolerance", "0.001")
        assert found["pieces"] == [[0, 1], [2]]
        assert "2 pieces of 2, 1 parts (apart: c); set `contact.tolerance: 0.01`" in found["warnings"][0]

    def test_shapes_without_a_common_type_are_shown(self, tmp_path: Path, capsys: Any) -> None:
        slabs = {name: box((1, 1, 2), at) for name, at in (("a", (0, 0, 0)), ("b", (1, 0, 0)))}
        found = seen(capsys, ring(tmp_path), write_obj(tmp_path / "slabs.obj", slabs))
        assert sum("shares no part type" in warning for warning in found["warnings"]) == 2

    def test_a_part_without_area_is_left_out_and_named(self, tmp_path: Path, capsys: Any) -> None:
        flat = box() * [1, 0, 0]
        found = seen(capsys, write_obj(tmp_path / "flat.obj", {"a": box(), "line": flat, "b": box(at=(1, 0, 0))}))
        assert [part["name"] for part in found["parts"]] == ["a", "b"]
        assert found["contacts"] == [[0, 1]]
        assert "line (it has no triangle with area)" in found["warnings"][0]

    def test_nothing_that_repeats_is_pointed_out(self, tmp_path: Path, capsys: Any) -> None:
        found = seen(capsys, write_obj(tmp_path / "ab.obj", {"a": box(), "b": box((1, 1, 2), (1, 0, 0))}))
        assert "nothing can be exchanged" in found["warnings"][0]


class TestText:
    def test_people_read_a_table_and_get_a_picture(self, tmp_path: Path, capsys: Any) -> None:
        out = tmp_path / "new"
        assert main([str(ring(tmp_path)), "--out", str(out), "--up", "z", "--tries", "100"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == str(tmp_path / "ring.obj")
        text = "\n".join(" ".join(line.split()) for line in lines)
        assert "parts 4 by objects (4 named objects)" in text
        assert "contacts 6: 4 over a face, 2 along a line" in text
        assert "connected yes" in text
        assert "cube 4 12 24" in text
        assert "grammar 1 neighbourhoods, 2 dockings of 1 part types" in text
        assert f"picture {out / 'ring.png'}" in text
        assert text.endswith(f"config {out / 'ring.yaml'}")
        with Image.open(out / "ring.png") as image:
            assert min(image.size) > 400

    def test_without_a_place_the_picture_goes_to_the_output_folder(
        self, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = ring(tmp_path)
        monkeypatch.chdir(tmp_path)
        assert main([str(path), "--tries", "100"]) == 0
        assert {each.name for each in (tmp_path / "datasets" / "inspect").iterdir()} >= {"ring.png", "ring.yaml"}

    def test_several_models_have_a_column_each(self, tmp_path: Path, capsys: Any) -> None:
        pair = f"{ring(tmp_path)} {ring(tmp_path, 'again.obj')}"  # as in MESH="ring.obj again.obj"
        assert main([pair, "--out", str(tmp_path / "out"), "--tries", "100"]) == 0
        text = " ".join(capsys.readouterr().out.split())
        assert "type in 1 in 2 triangles symmetries cube 4 4 12 24" in text


class TestMistakes:
    def test_a_file_that_is_not_there_is_named_with_the_nearest(self, tmp_path: Path, capsys: Any) -> None:
        ring(tmp_path)
        assert main([str(tmp_path / "rin.obj"), "--json"]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert "no such file; did you mean ring.obj?" in printed.err

    def test_a_broken_file_is_named(self, tmp_path: Path, capsys: Any) -> None:
        (tmp_path / "cut.glb").write_bytes(b"glTF\x02\0\0\0")
        assert main([str(tmp_path / "cut.glb")]) == 2
        assert "cut.glb" in capsys.readouterr().err

    def test_a_tolerance_out_of_range_is_refused(self, tmp_path: Path, capsys: Any) -> None:
        assert main([str(ring(tmp_path)), "--tolerance", "3"]) == 2
        assert "--tolerance" in capsys.readouterr().err

    def test_a_picture_that_cannot_be_written_is_refused(self, tmp_path: Path, capsys: Any) -> None:
        path = ring(tmp_path)
        assert main([str(path), "--out", str(path), "--tries", "100"]) == 2
        assert "cannot be written" in capsys.readouterr().err

    @pytest.mark.parametrize(
        "arguments", [["--kinds", "edge"], ["--parts", "things"], ["--types", "x"], ["--meaning", "x"], []]
    )
    def test_a_wrong_option_shows_the_usage(self, arguments: list[str], tmp_path: Path, capsys: Any) -> None:
        models = [str(ring(tmp_path))] if arguments else []
        with pytest.raises(SystemExit) as stopped:
            main([*models, *arguments])
        assert stopped.value.code == 2
        assert "usage: pipeline inspect" in capsys.readouterr().err


def test_the_command_prints_one_json_object_and_nothing_else(tmp_path: Path) -> None:
    path = ring(tmp_path)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "pipeline", "inspect", str(path), "--json", "--tries", "100", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["files"]["picture"] == str(out / "ring.png")
    assert (out / "ring.png").stat().st_size > 10_000
    missing = subprocess.run([*command[:4], str(tmp_path / "no.obj")], capture_output=True, text=True, check=False)
    assert (missing.returncode, missing.stdout) == (2, "")
