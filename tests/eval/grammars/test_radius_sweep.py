"""The sweep of the radius of similarity, as a table and a figure."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import shapemill
from tests.stages.symmetry.planted import mesh, wall


def test_sweep_has_a_row_per_radius_and_a_figure(tmp_path: Path) -> None:
    vertices, faces = mesh(wall(3)[..., [1, 2, 0]])  # y points up
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    (tmp_path / "wall.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    code, printed = shapemill(
        "eval", "radius_sweep", str(tmp_path / "wall.obj"), "--set", "radii=[0.06, 0.03]", "--out", str(tmp_path)
    )
    assert code == 0
    cells = [line.split("|")[1:-1] for line in printed.splitlines() if line.startswith("|")]
    rows = [row for row in cells if row[0].strip().endswith("%")]
    assert [row[0].strip() for row in rows] == ["3.0%", "6.0%"]
    assert int(rows[0][1].replace(",", "")) > 3 * int(rows[1][1].replace(",", ""))
    assert (tmp_path / "eval" / "radius_sweep_wall.png").read_bytes().startswith(b"\x89PNG")
    assert int(rows[1][3]) > 0
    # on its back it has fewer upright transforms, and so fewer docking sites
    settings = ["--set", "radii=[0.06]", "--set", "up=z"]
    command = ["radius_sweep", str(tmp_path / "wall.obj"), *settings, "--out", str(tmp_path)]
    code, printed = shapemill("eval", *command)
    assert code == 0
    lying = [line.split("|")[1:-1] for line in printed.splitlines() if line.startswith("| 6.0%")]
    assert lying[0][3:6] != rows[1][3:6]


def test_missing_file_is_reported(tmp_path: Path) -> None:
    code, printed = shapemill("eval", "radius_sweep", str(tmp_path / "none.glb"))
    assert code == 2
    assert "none.glb" in printed


@pytest.mark.parametrize("radius", ["0", "-0.01", "1.6"])
def test_radius_outside_the_config_range_is_refused_before_any_work(radius: str, tmp_path: Path) -> None:
    (tmp_path / "wall.obj").write_text("never read", encoding="utf-8")
    code, printed = shapemill("eval", "radius_sweep", str(tmp_path / "wall.obj"), "--set", f"radii=[0.03, {radius}]")
    assert code == 2
    assert "0.004 to 0.1" in printed


@pytest.mark.parametrize("radius", ["nan", ".nan"])
def test_radius_that_is_no_number_is_refused(radius: str, tmp_path: Path) -> None:
    (tmp_path / "wall.obj").write_text("never read", encoding="utf-8")
    code, printed = shapemill("eval", "radius_sweep", str(tmp_path / "wall.obj"), "--set", f"radii=[0.03, {radius}]")
    assert code == 2
    assert "radii" in printed
