"""What the README says about using Shapemill from Python is run, line by line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pipeline.shards import ShardWriter
from stages.package.glb import glb_bytes
from stages.shape.shape import kit_shape
from stages.shape.views.portrait import PAPER
from tests.stages.package.toy import chain, toy_kit

ROOT = Path(__file__).resolve().parents[1]
SECTION = (ROOT / "README.md").read_text().partition("\n## Using it from Python\n")[2].partition("\n## ")[0]
BLOCKS = dict(re.findall(r"\n([A-Z][^\n]*):\n\n```python\n(.*?)```", SECTION, re.DOTALL))

pytestmark = pytest.mark.slow


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs the code under a sentence of the README in a folder with the shipped exemplars; what it has defined."""
    (tmp_path / "datasets").mkdir()
    (tmp_path / "datasets/exemplars").symlink_to(ROOT / "datasets/exemplars")
    monkeypatch.chdir(tmp_path)

    def run_block(sentence: str) -> dict[str, Any]:
        defined: dict[str, Any] = {}
        exec(compile(BLOCKS[sentence], "README.md", "exec"), defined)
        return defined

    return run_block


def drawn(path: Path) -> bool:
    """Whether a picture shows something."""
    return float(np.mean(np.asarray(Image.open(path)) != PAPER)) > 0.05


def test_each_example_has_fewer_than_ten_lines() -> None:
    assert len(BLOCKS) == 4
    assert all(len([line for line in code.splitlines() if line]) < 10 for code in BLOCKS.values())


def test_a_chair_from_its_parameters(run: Any, tmp_path: Path) -> None:
    defined = run("A chair from its parameters")
    assert (defined["values"]["scale x"], defined["values"]["seat_pos"]) == (1.4, 0.8)
    assert drawn(tmp_path / "chair.png")


def test_a_kit_read_and_varied(run: Any) -> None:
    defined = run("A kit read from models, and five variants of it")
    kit, shapes = defined["kit"], defined["shapes"]
    assert (kit.name, len(kit.exemplars)) == ("castle", 2)
    assert len(shapes) == 5
    assert len({shape.assembly.poses.tobytes() for shape in shapes}) == 5
    exemplars = {each.assembly.poses.tobytes() for each in kit.exemplars}
    assert not exemplars & {shape.assembly.poses.tobytes() for shape in shapes}
    seen = {index: set(rules) for index, rules in kit.grammar.neighbourhoods.items()}
    for shape in shapes:
        types, edges = shape.assembly.types.tolist(), shape.assembly.edges.tolist()
        for part, index in enumerate(types):
            around = [types[j if i == part else i] for i, j in edges if part in (i, j)]
            assert tuple((each, around.count(each)) for each in sorted(set(around))) in seen[index]


def test_a_program_executed(run: Any) -> None:
    defined = run("A ShapeAssembly program executed")
    assert defined["execution"].corners.shape == (len(defined["shape"]), 8, 3)
    assert len(defined["shape"]) > 5


def test_a_sample_of_a_dataset_drawn(run: Any, tmp_path: Path) -> None:
    folder = tmp_path / "datasets/shapemill-default/data/test"
    folder.mkdir(parents=True)
    shape = kit_shape(toy_kit("blocks"), chain(5, 0))
    with open(folder / "a.tar", "wb") as stream, ShardWriter(stream) as writer:
        writer.write("blocks-000003", {"glb": glb_bytes(shape)})
    run("A sample of a dataset drawn")
    assert drawn(tmp_path / "blocks-000003.png")
