"""Extraction in the real pipeline: programs out of hierarchies, refusals by name, the same bytes with any workers."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml

from stages.shape.sample import Sample, read_samples
from stages.shapeassembly import execute, parse
from stages.shapeassembly.extraction.hierarchy import PartNode
from tests.stages.shapeassembly.extraction.shapes import hierarchy, leaf


def structurenet(part: PartNode) -> dict[str, object]:
    box = part.box
    numbers = [*box.center.tolist(), *box.size.tolist(), *box.axes[0].tolist(), *box.axes[1].tolist()]
    return {"label": part.label, "box": numbers, "children": [structurenet(child) for child in part.children]}


def tables(folder: Path) -> Path:
    """Ten tables of different heights, one in pieces, and one file that is no JSON."""
    folder.mkdir()
    for number in range(10):
        high = 0.6 + 0.05 * number
        legs = [leaf("leg", (x, -0.05 - high / 2, z), (0.1, high, 0.1)) for x in (-0.7, 0.7) for z in (-0.3, 0.3)]
        shape = hierarchy(leaf("top", (0, 0, 0), (1.6, 0.1, 0.8)), *legs)
        (folder / f"{number}.json").write_text(json.dumps(structurenet(shape.root)), encoding="utf-8")
    pieces = hierarchy(*(leaf("piece", (0, 3.0 * i * i, 0), (1, 1 + i, 1)) for i in range(4)))
    (folder / "pieces.json").write_text(json.dumps(structurenet(pieces.root)), encoding="utf-8")
    (folder / "broken.json").write_text("{", encoding="utf-8")
    return folder


def made(folder: Path, workers: int) -> tuple[str, Path]:
    """Run the stage on the tables; what it printed and its folder."""
    section = {"hierarchies": [{"name": "table", "path": str(folder / "tables"), "kind": "structurenet"}]}
    config = folder / "toy.yaml"
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 5, "shapeassembly": section}), encoding="utf-8")
    out = folder / f"out-{workers}"
    command = [sys.executable, "-m", "pipeline", "run", "shapeassembly", "--config", str(config), "--out", str(out)]
    done = subprocess.run([*command, "--workers", str(workers)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr, out / ".work" / "toy" / "shapeassembly"


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, Path]:
    folder = tmp_path_factory.mktemp("toy")
    tables(folder / "tables")
    return (folder, *made(folder, 1))


def samples(folder: Path) -> list[Sample]:
    return [sample for path in sorted(folder.glob("toy-*.tar")) for sample in read_samples(path)]


def test_every_table_becomes_a_sample_whose_text_is_its_program(toy: tuple[Path, str, Path]) -> None:
    found = samples(toy[2])
    assert sorted(sample.lineage["parents"][0] for sample in found) == [f"{number}.json" for number in range(10)]
    assert len({sample.key for sample in found}) == 10
    for sample in found:
        assert len(execute(parse(sample.text))) == 5


def test_programs_of_one_structure_share_a_split(toy: tuple[Path, str, Path]) -> None:
    assert len({sample.split for sample in samples(toy[2])}) == 1


def test_rejections_are_counted_by_reason(toy: tuple[Path, str, Path]) -> None:
    lines = [line for path in (toy[2] / "rejects").iterdir() for line in path.read_text(encoding="utf-8").splitlines()]
    refused = Counter(json.loads(line)["reason"] for line in lines)
    assert refused == {"unreadable hierarchy": 1, "parts not connected": 1}
    assert "1 unreadable hierarchy" in toy[1]


def test_bytes_do_not_depend_on_workers(toy: tuple[Path, str, Path]) -> None:
    folder, _, alone = toy
    _, together = made(folder, 2)
    first, second = ({path.name: path.read_bytes() for path in value.glob("toy-*")} for value in (alone, together))
    assert first == second
