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
    - {{name: wall, model: {model}, credit: {{license: MIT}}, radius: 0.03, up: z, instances: 2, resized: {resized},
       max_cells: 2, max_pieces: 1}}
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wall of four windows as a file."""
    vertices, faces = mesh(wall(4))
    path = tmp_path_factory.mktemp("model") / "wall.off"
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0", *(" ".join(map(str, each)) for each in vertices.tolist())]
    path.write_text("\n".join([*lines, *("3 " + " ".join(map(str, each)) for each in faces.tolist())]) + "\n")
    return path


def test_a_mesh_becomes_shards_of_other_walls_and_the_run_says_that_there_are_no_more(
    model: Path, tmp_path: Path
) -> None:
    config = tmp_path / "walls.yaml"
    config.write_text(CONFIG.format(model=model, resized=9))
    code, said = shapemill("run", "grammars", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code == 0, said
    assert "3 samples" in said
    assert "wall: 3 of 11 shapes that are asked for" in said
    listed = sorted((tmp_path / "out" / ".work" / "walls" / "grammars").rglob("walls-drawing.*.jsonl"))
    rows = [json.loads(line) for each in listed for line in each.read_text().splitlines()]
    assert len({row["text"] for row in rows}) == 3
    assert {row["kit"] for row in rows} == {"wall"}
