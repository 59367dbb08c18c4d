"""The stage in the real pipeline: counts, splits, no duplicates, equal bytes with any number of workers."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from pathlib import Path

import pytest
import yaml

from stages.programs.program import find_program, shape_from_text
from stages.programs.sampling import all_value_indices, has_effect, structure_digest
from stages.shape.sample import Sample, read_samples
from tests.command import shapemill
from tests.stages.programs.stool import PROGRAM as STOOL_PROGRAM

STOOL, RACK = "tests.stages.programs.stool", "tests.stages.programs.rack"
ALL_VALUES = {"program": STOOL, "all_values": {"train": 2, "val": 1, "test": 1}, "splits": {"shards": 2}}
RANDOM = {
    "program": RACK,
    "mode": "random",
    "random": {"samples": 200, "val": 0.2, "test": 0.15},
    "splits": {"shards": 1, "samples_per_shard": 60},
}


def make(folder: Path, section: dict[str, object], workers: int = 1) -> tuple[int, str, Path]:
    """Run the stage; its exit code, what it printed and its folder."""
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "seed": 5, "programs": section}), encoding="utf-8")
    out = folder / f"out-{workers}"
    code, printed = shapemill("run", "programs", "--config", path, "--out", out, "--workers", workers)
    return code, printed, out / ".work" / "toy" / "programs"


def shards_of(folder: Path) -> dict[str, list[Sample]]:
    return {path.stem: list(read_samples(path)) for path in sorted(folder.glob("toy-*.tar"))}


def digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("toy-*.tar"))}


@pytest.fixture(scope="module")
def stools(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, Path]:
    folder = tmp_path_factory.mktemp("stools")
    code, printed, made = make(folder, ALL_VALUES)
    assert code == 0, printed
    return folder, printed, made


@pytest.fixture(scope="module")
def racks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    code, printed, made = make(tmp_path_factory.mktemp("racks"), RANDOM)
    assert code == 0, printed
    return made


def test_every_value_is_fixed_in_the_requested_number_of_shapes(stools: tuple[Path, str, Path]) -> None:
    counts: Counter[tuple[str, str, int]] = Counter()
    for shard, samples in shards_of(stools[2]).items():
        for sample in samples:
            assert sample.split == shard.split("-")[1]
            counts[sample.split, sample.lineage["parameter"], sample.lineage["class"]] += 1
    indices = all_value_indices(STOOL_PROGRAM)
    expected = {("train", *value): 2 for value in indices} | {
        (split, *value): 1 for value in indices for split in ("val", "test")
    }
    assert counts == expected


def test_fixed_value_is_visible_and_takes_effect(stools: tuple[Path, str, Path]) -> None:
    schema = STOOL_PROGRAM.schema
    for samples in shards_of(stools[2]).values():
        for sample in samples:
            values, name = schema.from_text(sample.text), sample.lineage["parameter"]
            assert name in json.loads(sample.text)
            assert schema.to_classes(values)[list(schema.by_name).index(name)] == sample.lineage["class"]
            assert has_effect(STOOL_PROGRAM, values, name, STOOL_PROGRAM.parts(values))
            assert not STOOL_PROGRAM.violated(values)


@pytest.mark.parametrize("made", ["stools", "racks"])
def test_there_are_no_duplicates_and_keys_differ(made: str, request: pytest.FixtureRequest) -> None:
    fixture = request.getfixturevalue(made)
    shards = shards_of(fixture[2] if made == "stools" else fixture)
    samples = [sample for shard in shards.values() for sample in shard]
    assert len({sample.text for sample in samples}) == len(samples)
    assert sorted(sample.key for sample in samples) == [f"{made[:-1]}-{number:06d}" for number in range(len(samples))]


def test_sample_is_its_parameters(stools: tuple[Path, str, Path]) -> None:
    sample = shards_of(stools[2])["toy-train-000000"][0]
    assert (sample.producer, sample.kit) == ("programs", STOOL)
    assert len(sample.assembly) == 0
    values = STOOL_PROGRAM.schema.from_text(sample.text)
    assert sample.graph == structure_digest(STOOL_PROGRAM, values)
    assert len(shape_from_text(sample.kit, sample.text)) == len(STOOL_PROGRAM.parts(values))


def test_bytes_do_not_depend_on_the_number_of_workers(stools: tuple[Path, str, Path]) -> None:
    code, printed, made = make(stools[0], ALL_VALUES, workers=2)
    assert code == 0, printed
    assert digests(made) == digests(stools[2])
    assert len(digests(made)) == 6


def test_refused_draws_are_counted_by_reason_and_reported(stools: tuple[Path, str, Path]) -> None:
    assert "96 shapes of" in stools[1]
    assert "% hidden" in stools[1]
    assert "% seat intersects rail" in stools[1]
    written = [path.read_text(encoding="utf-8") for path in sorted((stools[2] / "rejects").glob("*.jsonl"))]
    rejects = [json.loads(line) for line in "".join(written).splitlines()]
    assert rejects
    assert {reject["item"] for reject in rejects} <= set(STOOL_PROGRAM.schema.by_name)


def test_random_sampling_has_the_requested_shapes_split_by_structure(racks: Path) -> None:
    shards = shards_of(racks)
    splits: dict[str, list[Sample]] = {}
    for name, samples in shards.items():
        assert len(samples) <= 60
        splits.setdefault(name.split("-")[1], []).extend(samples)
    assert {split: len(samples) for split, samples in splits.items()} == {"train": 130, "val": 40, "test": 30}
    structures = {split: {sample.graph for sample in samples} for split, samples in splits.items()}
    assert len(set().union(*structures.values())) == sum(map(len, structures.values()))
    listed = set(find_program(RACK).schema.by_name["width"].values)
    widths = {json.loads(sample.text)["width"] for sample in splits["train"]}
    assert len(widths - listed) > 100


def test_unknown_program_is_reported(tmp_path: Path) -> None:
    code, printed, _ = make(tmp_path, {"program": "chiar"})
    assert code == 2
    assert "there is no program 'chiar'" in printed
