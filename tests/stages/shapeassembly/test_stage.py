"""The stage in the pipeline: what becomes a sample, what is refused and why, splits, the same bytes always."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import tarfile
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import yaml

from pipeline.errors import ShardFailed
from stages.shape.sample import Sample, read_samples
from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.settings import ProgramFiles, ShapeAssemblyConfig
from stages.shapeassembly.shape import shape_of_program_text
from stages.shapeassembly.splits import splits_of
from tests.command import shapemill

EXAMPLES = sorted(Path("datasets/exemplars/programs").glob("*.txt"))
CHAIR = next(path.read_text(encoding="utf-8") for path in EXAMPLES if path.stem == "chair-slats")
BAD = {
    "binary.txt": b"\xff\xfe\x00",
    "circle.txt": b"Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) P = Cuboid(0.5, 0.5, 0.5, True) }",
    "outside.txt": b"Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) a = Cuboid(1.5, 0.5, 0.5, True) }",
    "again.txt": CHAIR.replace("\t", "  ").encode(),
    "empty.txt": b"Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) }",
}
REASONS = {
    "binary.txt": "syntax",
    "circle.txt": "too deep",
    "outside.txt": "reaches out of the bounding box",
    "again.txt": "duplicate program",
    "empty.txt": "number of parts",
}


def make(folder: Path, section: dict[str, object], workers: int = 1) -> tuple[int, str, Path]:
    """Run the stage; its exit code, what it printed and its folder."""
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "seed": 5, "shapeassembly": section}), encoding="utf-8")
    out = folder / f"out-{workers}"
    code, printed = shapemill("run", "shapeassembly", "--config", path, "--out", out, "--workers", workers)
    return code, printed, out / ".work" / "toy" / "shapeassembly"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Our own programs, each in three sizes that have one structure; and bad ones."""
    folder = tmp_path_factory.mktemp("programs")
    (folder / "good").mkdir()
    for path in EXAMPLES:
        for number in range(3):
            text = path.read_text(encoding="utf-8").replace(
                "0.5, 0.0, 0.5, 0.5, 1.0, 0.5", f"0.5, 0.0, 0.5, 0.5, 1.0, 0.5{number}"
            )
            (folder / "good" / f"{path.stem}-{number}.txt").write_text(
                text if number else path.read_text(encoding="utf-8"), encoding="utf-8"
            )
    (folder / "bad").mkdir()
    for name, content in BAD.items():
        (folder / "bad" / name).write_bytes(content)
    (folder / "bad" / "link.txt").symlink_to(EXAMPLES[0].resolve())
    return folder


@pytest.fixture(scope="module")
def made(folder: Path) -> tuple[str, Path]:
    sources = [{"name": "good", "path": str(folder / "good")}, {"name": "bad", "path": str(folder / "bad")}]
    code, printed, out = make(folder, {"programs": sources, "splits": {"shards": 2, "val": 0.2, "test": 0.2}})
    assert code == 0, printed
    return printed, out


def samples(out: Path) -> dict[str, list[Sample]]:
    return {path.stem: list(read_samples(path)) for path in sorted(out.glob("toy-*.tar"))}


def test_samples_are_canonical_programs_split_by_structure(made: tuple[str, Path]) -> None:
    found = [sample for shard in samples(made[1]).values() for sample in shard]
    splits: dict[str, set[str]] = {}
    for sample in found:
        assert (sample.producer, sample.kit) == ("shapeassembly", "good")
        assert sample.graph == signature(parse(sample.text))
        assert len(shape_of_program_text(sample.text)) > 0
        splits.setdefault(sample.graph, set()).add(sample.split)
    assert len(splits) == len(EXAMPLES)
    assert all(len(split) == 1 for split in splits.values())
    assert {split for item in splits.values() for split in item} == {"train", "val", "test"}
    assert len({sample.key for sample in found}) == len(found)
    assert "12 structures" in made[0]


def test_the_labels_of_a_category_are_those_of_all_its_programs_in_order(made: tuple[str, Path]) -> None:
    listed = json.loads((made[1] / "toy-assignment.labels.json").read_text(encoding="utf-8"))
    labels = {label for path in EXAMPLES for label in execute(parse(path.read_text(encoding="utf-8"))).labels}
    assert listed == {"good": sorted(labels)}
    assert {"Armchair/arm", "Desk/Drawers/Front/panel"} <= labels


def test_invalid_program_is_rejected_with_its_reason(made: tuple[str, Path]) -> None:
    lines = [
        json.loads(line)
        for path in (made[1] / "rejects").iterdir()
        for line in path.read_text(encoding="utf-8").splitlines()
    ]
    found = {line["item"]: line["reason"] for line in lines if line["item"].startswith("bad/")}
    assert found == {f"bad/{name}": reason for name, reason in REASONS.items()}


def test_bytes_do_not_depend_on_the_number_of_workers(folder: Path, made: tuple[str, Path]) -> None:
    sources = [{"name": "good", "path": str(folder / "good")}, {"name": "bad", "path": str(folder / "bad")}]
    code, printed, out = make(folder, {"programs": sources, "splits": {"shards": 2, "val": 0.2, "test": 0.2}}, 2)
    assert code == 0, printed

    def digests(path: Path) -> dict[str, str]:
        return {item.name: hashlib.sha256(item.read_bytes()).hexdigest() for item in sorted(path.glob("toy-*"))}

    assert digests(out) == digests(made[1])


def test_an_archive_is_read_like_a_folder(folder: Path, tmp_path: Path) -> None:
    archive = tmp_path / "programs.tar.xz"
    with tarfile.open(archive, "w:xz") as tar:
        for path in EXAMPLES[::-1]:
            tar.add(path, f"data/furniture/{path.name}")
        stray = tarfile.TarInfo("../data/furniture/stray.txt")
        tar.addfile(stray, io.BytesIO())
    section = {"programs": [{"name": "furniture", "path": str(archive), "folder": "data/furniture"}], "accept": "valid"}
    code, printed, out = make(tmp_path, section)
    assert code == 0, printed
    found = [sample for shard in samples(out).values() for sample in shard]
    assert sorted(sample.lineage["parents"][0] for sample in found) == [f"data/furniture/{e.name}" for e in EXAMPLES]


def test_edits_share_the_split_of_their_program(folder: Path, tmp_path: Path) -> None:
    splits = {"shards": 1, "val": 0.2, "test": 0.2}
    entry = {"name": "good", "path": str(EXAMPLES[0].parent.resolve()), "edits": 3, "log_std": 0.1}
    code, printed, out = make(tmp_path, {"programs": [entry], "splits": splits, "accept": "valid"})
    assert code == 0, printed
    found = [sample for shard in samples(out).values() for sample in shard]
    own = {sample.lineage["parents"][0]: sample for sample in found if sample.lineage["method"] == "executed"}
    edits = [sample for sample in found if sample.lineage["method"] == "edited"]
    refused = sum(1 for path in (out / "rejects").iterdir() for _ in path.read_text(encoding="utf-8").splitlines())
    assert len(own) == len(EXAMPLES)
    assert len(edits) + refused == 3 * len(EXAMPLES)
    assert len(edits) > 2 * len(EXAMPLES)
    for sample in edits:
        parent = own[sample.lineage["parents"][0]]
        assert (sample.split, sample.graph) == (parent.split, parent.graph)
    assert len({sample.text for sample in found}) == len(found) == len({sample.key for sample in found})


def test_missing_source_is_reported_before_the_run(tmp_path: Path) -> None:
    code, printed, _ = make(tmp_path, {"programs": [{"name": "a", "path": str(tmp_path / "nothing")}]})
    assert code == 2
    assert "there is no folder and no file" in printed
    (tmp_path / "a.txt").write_text(CHAIR, encoding="utf-8")
    code, printed, _ = make(tmp_path, {"programs": [{"name": "a", "path": str(tmp_path / "a.txt")}]})
    assert code == 2
    assert "neither a folder nor a tar archive" in printed


def test_published_lists_make_the_splits(folder: Path, tmp_path: Path) -> None:
    """All programs of a structure would stand in one split; a list parts them, and what it does not name is train."""
    source = tmp_path / "listed"
    shutil.copytree(folder / "good", source / "data")
    names = sorted(path.stem for path in (source / "data").glob("*.txt"))
    (source / "val.txt").write_text("".join(f"{name}\n" for name in names[::3]), encoding="utf-8")
    (source / "test.txt").write_text(f"{names[1]}.txt\nnot-there\n", encoding="utf-8")
    (source / "none.txt").write_text("nobody\n", encoding="utf-8")
    entry = {"name": "good", "path": str(source), "lists": {"val": "val.txt", "test": "test.txt"}}
    code, printed, out = make(tmp_path, {"programs": [entry]})
    assert code == 0, printed
    found = {sample.lineage["parents"][0]: sample.split for shard in samples(out).values() for sample in shard}
    expected = {
        name: "val" if place % 3 == 0 else "test" if place == 1 else "train" for place, name in enumerate(names)
    }
    assert found == {name: expected[Path(name).stem] for name in found}
    assert set(found.values()) == {"train", "val", "test"}
    assert len(found) >= len(EXAMPLES)


@pytest.mark.parametrize(
    ("lists", "said"),
    [
        ({"val": "gone.txt"}, "there is no gone.txt"),
        ({"val": "none.txt"}, "name none of its programs"),
        ({"val": "val.txt", "test": "val.txt"}, "for both val and test"),
    ],
)
def test_invalid_lists_are_reported(tmp_path: Path, lists: dict[Literal["val", "test"], str], said: str) -> None:
    (tmp_path / "val.txt").write_text("one\n", encoding="utf-8")
    (tmp_path / "none.txt").write_text("nobody\n", encoding="utf-8")
    (tmp_path / "one.txt").write_text(CHAIR, encoding="utf-8")
    config = ShapeAssemblyConfig(programs=(ProgramFiles(name="good", path=tmp_path, lists=lists),))
    rows = [{"kit": "good", "file": "one.txt", "graph": "a"}]
    with pytest.raises(ShardFailed, match=said):
        splits_of(rows, config, np.random.default_rng(0))
