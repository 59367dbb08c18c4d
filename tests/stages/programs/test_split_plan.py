"""Random sampling finishes for any small program, and reports missing shapes."""

from __future__ import annotations

import itertools
import json
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

from pipeline.config import load_config
from pipeline.errors import ConfigError
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.task import Report, make_shard
from stages.programs.conditions import Condition
from stages.programs.curves import Part, box
from stages.programs.parameters import discrete
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values
from stages.programs.settings import RandomSamplingConfig
from stages.programs.split_plan import listed_shapes, plan_splits
from stages.shape.sample import Sample, read_samples
from tests.stages.programs.lid import LID, PROGRAM, WIDTH, build
from tests.stages.programs.rack import PROGRAM as RACK

FIXED = replace(PROGRAM, parameters=())
WIDE = replace(PROGRAM, parameters=(LID, WIDTH))
HEAP = replace(PROGRAM, parameters=(LID, discrete("boxes", 1, 4, 1, "boxes", "Number of boxes.")))
"""Eight combinations of parameters, each a shape and a structure of its own."""
THREE = replace(WIDE, parameters=(*WIDE.parameters, discrete("boxes", 1, 3, 1, "boxes", "Number of boxes.")))

RACK_OF_ONE_WIDTH = replace(RACK, parameters=(RACK.parameters[0], RACK.parameters[2]))


def sunk(values: Values) -> Sequence[Part]:
    """As `build`, but the lid is in the box."""
    return [*build({**values, "has_lid": False}), *([SUNK_PART] if values["has_lid"] else [])]


SUNK_PART = Part("lid", box((0.5, 0.3, 0.5), (0, 1, 0)), (180, 180, 180))
SUNK = replace(HEAP, build=sunk, non_intersecting=(("case", "lid"),))
"""All shapes with a lid are refused, but only after they are built."""

Name = Callable[[Program], str]
NUMBERS = itertools.count()


@pytest.fixture
def name_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Name:
    """Puts a program into a module of its own, as a user does, and returns its unique name."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "__init__.py").write_text("", encoding="utf-8")

    def name(program: Program) -> str:
        number = next(NUMBERS)
        (tmp_path / "mine" / f"program{number}.py").write_text(f"NUMBER = {number}\n", encoding="utf-8")
        module = ModuleType(f"mine.program{number}")
        vars(module).update(PROGRAM=program)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return module.__name__

    return name


def make(folder: Path, program: str, samples: int, *stages: str) -> tuple[list[Report], list[Sample], list[str]]:
    """Run `stages` for a program in mode random: the end of each shard, all samples, and the report of the stage."""
    section = {"program": program, "mode": "random", "random": {"samples": samples}, "splits": {"shards": 2}}
    small = {"points": {"uniform": 64}, "package": {"previewed": 2}}
    small["sketches"] = {"size": 48, "renderer": "raster", "views": [{"name": "front"}]}
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "seed": 5, "programs": section, **small}), encoding="utf-8")
    known = find_stages()
    config = load_config(path, {name: stage.config for name, stage in known.items()})
    paths, reports = DatasetPaths(folder / "out", "toy"), []
    inventory = Inventory(config, known, paths)
    for stage in stages or ("programs",):
        paths.stage(stage).make()
        stage_inventory = inventory.stage(stage)
        tried: set[str] = set()
        while ready := [
            shard for shard in stage_inventory.missing if shard.name not in tried and stage_inventory.ready(shard)
        ]:
            tried |= {shard.name for shard in ready}
            reports += [make_shard(inventory.job(stage, shard)) for shard in ready]
            inventory.refresh(stage)
    folder = paths.stage("programs").root
    samples_made = [sample for tar in sorted(folder.glob("*.tar")) for sample in read_samples(tar)]
    return reports, samples_made, list(known["programs"].report(inventory.stage("programs").view))


def splits_of(samples: Sequence[Sample]) -> dict[str, int]:
    return dict(Counter(sample.split for sample in samples))


def test_binary_parameter_gives_both_shapes_and_leaves_a_split_empty(tmp_path: Path, name_of: Name) -> None:
    reports, samples, notes = make(tmp_path, name_of(PROGRAM), 100)
    assert {report.status for report in reports} == {"done"}
    assert {sample.text for sample in samples} == {'{"has_lid":false}', '{"has_lid":true}'}
    assert splits_of(samples) == {"train": 1, "test": 1}
    assert notes[1:] == [
        "100 shapes were requested, but the program has only 2", "split val is empty: no shape is left for it"
    ]  # fmt: skip


def test_program_with_one_shape_gives_it(tmp_path: Path, name_of: Name) -> None:
    reports, samples, notes = make(tmp_path, name_of(FIXED), 10)
    assert [report.status for report in reports] == ["done"]
    assert [(sample.text, sample.split) for sample in samples] == [("{}", "train")]
    assert "split test is empty: no shape is left for it" in notes


def test_two_structures_are_split_by_continuous_values(tmp_path: Path, name_of: Name) -> None:
    _, samples, notes = make(tmp_path, name_of(WIDE), 40)
    assert splits_of(samples) == {"train": 32, "val": 4, "test": 4}
    assert len({sample.text for sample in samples}) == 40
    assert {sample.lineage["split_by"] for sample in samples} == {"values"}
    assert any("fewer structures than splits" in line for line in notes)


def test_one_structure_is_split_by_continuous_values(tmp_path: Path, name_of: Name) -> None:
    _, samples, _ = make(tmp_path, name_of(replace(PROGRAM, parameters=(WIDTH,))), 20)
    assert splits_of(samples) == {"train": 16, "val": 2, "test": 2}
    assert len({sample.graph for sample in samples}) == 1


@pytest.mark.parametrize("seed", range(3))
def test_every_split_gets_some_of_few_structures(tmp_path: Path, name_of: Name, seed: int) -> None:
    # The hash of its values decides the split of a structure; other names have other hashes.
    boxes = discrete(f"boxes{seed}", 1, 3, 1, "boxes", "Number of boxes.")
    _, samples, notes = make(tmp_path, name_of(replace(PROGRAM, parameters=(boxes, WIDTH))), 40)
    assert splits_of(samples) == {"train": 32, "val": 4, "test": 4}
    kept = {split: {sample.graph for sample in samples if sample.split == split} for split in ("train", "val", "test")}
    assert [len(graphs) for graphs in kept.values()] == [1, 1, 1]
    assert len(set().union(*kept.values())) == 3
    assert len(notes) == 1


def test_listed_shapes_are_shuffled_by_the_seed(name_of: Name) -> None:
    name = name_of(RACK_OF_ONE_WIDTH)
    split_plan = plan_splits(name, RandomSamplingConfig(samples=10))
    assert (split_plan.sizes, split_plan.shape_count) == ({"train": 8, "val": 1, "test": 1}, 24)
    owned = [split_plan.owned(split, 0, size)["listed"] for split, size in split_plan.sizes.items()]
    assert owned == [[0, 19], [19, 21], [21, 24]]
    first, second = listed_shapes(name, 1), listed_shapes(name, 2)
    assert first.shape == (2, 24)
    assert not np.array_equal(first, second)
    assert sorted(first.T.tolist()) == sorted(second.T.tolist())


def test_dataset_finishes_with_empty_shards(tmp_path: Path, name_of: Name) -> None:
    stages = ("exemplars", "variations", "programs", "shapeassembly", "validity", "strings", "points", "sketches")
    reports, samples, notes = make(tmp_path, name_of(SUNK), 100, *stages, "package")
    assert {report.status for report in reports} == {"done"}, [report.message for report in reports]
    assert sorted(json.loads(sample.text)["boxes"] for sample in samples) == [1, 2, 3, 4]
    assert not any(json.loads(sample.text)["has_lid"] for sample in samples)
    assert "100 shapes were requested, but the program has only 8" in notes
    assert any(line.startswith("split train has ") for line in notes)
    card = (tmp_path / "out/.work/toy/package/dataset.README.md").read_text(encoding="utf-8")
    assert "| total | 4 |" in card


def test_program_whose_shapes_are_all_refused_fails_with_reasons(tmp_path: Path, name_of: Name) -> None:
    never = replace(SUNK, build=lambda values: sunk({**values, "has_lid": True}))
    reports, _, _ = make(tmp_path, name_of(never), 100)
    assert {report.status for report in reports} == {"failed"}
    assert reports[0].message == "lid: none of its 8 shapes is valid (8 case intersects lid)"


def test_unsatisfiable_constraints_are_reported_first(tmp_path: Path, name_of: Name) -> None:
    never = replace(HEAP, constraints=(Constraint("never", Condition("boxes > 9"), "."),))
    with pytest.raises(ConfigError, match="no combination of its parameters satisfies all its constraints"):
        make(tmp_path, name_of(never), 100)


def test_structures_without_a_valid_shape_get_no_split(tmp_path: Path, name_of: Name) -> None:
    # One of three numbers of boxes is left; a split with the others would never end.
    only = replace(THREE, constraints=(Constraint("one", Condition("boxes < 2"), "."),))
    _, samples, _ = make(tmp_path, name_of(only), 30)
    assert splits_of(samples) == {"train": 24, "val": 3, "test": 3}
    assert {sample.lineage["split_by"] for sample in samples} == {"values"}
