"""The effect of the radius of similarity is told as a table and kept as a sheet."""

from __future__ import annotations

from pathlib import Path

import pytest

from eval.__main__ import main
from tests.stages.symmetry.planted import mesh, wall


def test_a_row_and_a_row_of_pictures_for_each_radius(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, faces = mesh(wall(3)[..., [1, 2, 0]])  # y points up
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    (tmp_path / "wall.obj").write_text("\n".join(lines) + "\n")
    assert main(["radii", str(tmp_path / "wall.obj"), "--radii", "0.06", "0.03", "--out", str(tmp_path)]) == 0
    told = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    rows = [each for each in told if each[0].strip().endswith("%")]
    assert [each[0].strip() for each in rows] == ["3.0%", "6.0%"]
    assert int(rows[0][1].replace(",", "")) > 3 * int(rows[1][1].replace(",", ""))
    assert (tmp_path / "eval" / "radii_wall.png").read_bytes().startswith(b"\x89PNG")
    assert int(rows[1][3]) > 0
    # lying on its back it has fewer motions that keep upright what is up, and so fewer sites
    command = ["radii", str(tmp_path / "wall.obj"), "--radii", "0.06", "--up", "z", "--out", str(tmp_path)]
    assert main(command) == 0
    lying = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines() if line.startswith("| 6.0%")]
    assert lying[0][3:6] != rows[1][3:6]


def test_a_file_that_is_not_there_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["radii", str(tmp_path / "none.glb")]) == 2
    assert "none.glb" in capsys.readouterr().err


@pytest.mark.parametrize("radius", ["0", "-0.01", "1.6", "nan"])
def test_a_radius_that_no_config_may_have_is_refused_before_any_work(
    radius: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wall.obj").write_text("never read")
    assert main(["radii", str(tmp_path / "wall.obj"), "--radii", "0.03", radius]) == 2
    assert "0.004 to 0.1" in capsys.readouterr().err
