from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.command import shapemill
from tests.stages.symmetry.planted import mesh, wall

CONFIG = """\
name: walls
seed: 1
license: MIT
grammars:
  models:
    - {{name: wall, model: {model}, credit: {{license: MIT}}, radius: 0.03, up: z, random_shapes: 2,
       resized_grids: {resized_grids}, max_cells: 2, max_pieces: 1}}
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a wall of four windows to a file."""
    vertices, faces = mesh(wall(4))
    path = tmp_path_factory.mktemp("model") / "wall.off"
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0", *(" ".join(map(str, vertex)) for vertex in vertices.tolist())]
    path.write_text(
        "\n".join([*lines, *("3 " + " ".join(map(str, face)) for face in faces.tolist())]) + "\n", encoding="utf-8"
    )
    return path


def test_run_makes_other_walls_and_warns_that_there_are_no_more(model: Path, tmp_path: Path) -> None:
    config = tmp_path / "walls.yaml"
    config.write_text(CONFIG.format(model=model, resized_grids=9), encoding="utf-8")
    code, output = shapemill("run", "grammars", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code == 0, output
    assert "3 samples" in output
    assert "wall: 3 of 11 requested shapes" in output
    listings = sorted((tmp_path / "out" / ".work" / "walls" / "grammars").rglob("walls-drawing.*.jsonl"))
    rows = [json.loads(line) for listing in listings for line in listing.read_text(encoding="utf-8").splitlines()]
    assert len({row["text"] for row in rows}) == 3
    assert {row["kit"] for row in rows} == {"wall"}
