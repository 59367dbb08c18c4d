"""The stage validity: fields of every sample, contacts of parts made from a text, what has no body is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.config import Config, StrictModel
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.shards import ShardWriter, read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.programs.program import find_program
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.packaged import PackagedSample
from stages.shape.collection.pairs import CONTACTS, JOINTS, pairs_of
from stages.shape.kit import Assembly
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, write_sample
from stages.shape.shape import Shape
from stages.validity.audit import AUDIT
from stages.validity.settings import ValidityConfig
from stages.validity.stage import STAGE
from tests.stages.shape.collection.absent import ABSENT_SECTIONS, ABSENT_STAGES, named_inputs
from tests.stages.shape.views.solids import box, kit_of, part_type, posed

STOOL = "tests.stages.programs.stool"


class KitsConfig(StrictModel):
    """Nothing to set."""


class SamplesConfig(StrictModel):
    """Nothing to set."""


def make_kit(task: Task) -> Outcome:
    thread = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]], dtype=np.int32)
    with task.output("solids.json") as text, task.output("solids.tar") as arrays:
        write_kit(kit_of(part_type("box", box()), part_type("thread", thread)), text, arrays)
    return Outcome(1)


def small(_: Plan) -> int:
    return 1000


def judged(out: Path, *samples: Sample, falls: bool = False) -> tuple[dict[str, dict[str, Any]], dict[str, int]]:
    """The fields of each sample, with its arrays by their names, and the rejects by reason, of a collection of
    `samples` of one producer."""

    def make_samples(task: Task) -> Outcome:
        with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
            for sample in samples:
                write_sample(writer, sample)
        return Outcome(len(samples), {"split": "train", "samples": len(samples)})

    def plan(_: Plan) -> list[Shard]:
        return [Shard("toys-train-000000")]

    producer = samples[0].producer
    stages: dict[str, Stage] = {
        "exemplars": Stage("exemplars", __name__, KitsConfig, (), lambda _: [Shard("solids")], make_kit, small),
        "variations": Stage("variations", __name__, SamplesConfig, ("exemplars",), lambda _: [], make_samples, small),
        **ABSENT_STAGES,
    }
    config_of = {"programs": ProgramsConfig}.get(producer, SamplesConfig)
    stages[producer] = Stage(producer, __name__, config_of, stages[producer].inputs, plan, make_samples, small)
    stages = named_inputs([*stages.values(), STAGE])
    sections = {
        "exemplars": KitsConfig(),
        "variations": SamplesConfig(),
        **ABSENT_SECTIONS,
        "validity": ValidityConfig(falls=falls),
    }
    if producer == "programs":
        sections["programs"] = ProgramsConfig(program=samples[0].kit)
    config = Config(name="toys", version="1.0.0", seed=5, sections=sections, path=Path("toys.yaml"))
    for name in stages:
        assert not run_stage(name, stages, config, DatasetPaths(out, "toys"), workers=1).failed
    found = read_shard(next(out.rglob("validity/**/toys-train-000000.tar")))
    record = json.loads(next(out.rglob("validity/**/records/toys-train-000000.json")).read_text(encoding="utf-8"))
    return {
        key: {**json.loads(members["json"]), **{name: pairs_of(members[name]).tolist() for name in (CONTACTS, JOINTS)}}
        for key, members in found
    }, record["rejects"]


def boxes(key: str, *offsets: tuple[float, float, float], kind: int = 0) -> Sample:
    types = np.full(len(offsets), kind, dtype=np.int16)
    assembly = Assembly(types, posed(*offsets), np.empty((0, 2), dtype=np.int32))
    return Sample(key, "train", "variations", "solids", "0" * 64, {}, assembly)


def test_a_tower_stands_and_what_hangs_in_the_air_does_not(tmp_path: Path) -> None:
    found, rejects = judged(tmp_path, boxes("tower", (0, 0, 0), (0, 1, 0)), boxes("loose", (0, 0, 0), (0, 4, 0)))
    assert found["tower"]["physics"]["rooted"]
    assert found["tower"]["physics"]["stable"]
    assert not found["loose"]["physics"]["rooted"]
    assert found["loose"]["physics"]["floating"] == 1
    assert rejects == {}


def test_what_topples_falls_where_that_is_asked_for(tmp_path: Path) -> None:
    """A tower of seven cubes tips at an angle of half a width in half a height."""
    tower = boxes("tower", *[(0, level, 0) for level in range(7)])
    tall = boxes("tall", *[(0, level, 0) for level in range(12)])
    found, _ = judged(tmp_path, tower, tall, boxes("loose", (0, 0, 0), (0, 4, 0)), falls=True)
    verdicts = {
        key: [record["physics"][name] for name in ("stable", "falls", "fallen")] for key, record in found.items()
    }
    assert verdicts == {"tower": [True, False, 0], "tall": [True, True, 0], "loose": [False, True, 1]}
    degrees = {key: record["physics"]["fall_degrees"] for key, record in found.items()}
    assert degrees["tower"] == pytest.approx(math.degrees(math.atan(1 / 7)))
    assert degrees["tall"] == pytest.approx(math.degrees(math.atan(1 / 12)))
    assert degrees["loose"] == 0.0


def test_a_sample_without_a_body_is_refused_and_counted(tmp_path: Path) -> None:
    found, rejects = judged(tmp_path, boxes("tower", (0, 0, 0)), boxes("thread", (0, 0, 0), kind=1))
    assert list(found) == ["tower"]
    assert rejects == {"no body to judge": 1}


def test_parts_that_a_program_makes_are_asked_whether_they_touch(tmp_path: Path) -> None:
    schema = find_program(STOOL).schema
    found, _ = judged(
        tmp_path, Sample("stool", "train", "programs", STOOL, "0" * 64, {}, text=schema.to_text(schema.base))
    )
    assert found["stool"][CONTACTS] == [[0, 1], [0, 2], [1, 3], [2, 3]]
    assert found["stool"]["physics"]["stable"]


def test_parts_that_are_near_and_do_not_touch_are_joints_and_no_contacts(tmp_path: Path) -> None:
    """The kit says that parts touch at most 0.001 apart; physics connects what is at most 2 % of the diagonal apart."""
    found, _ = judged(tmp_path, boxes("gap", (0, 0, 0), (0, 1.02, 0)))
    assert found["gap"][CONTACTS] == []
    assert found["gap"][JOINTS] == [[0, 1]]
    assert found["gap"]["physics"]["components"] == 1
    assert found["gap"]["contact_tolerance"] < 0.02 < found["gap"]["joint_tolerance"]
    assert found["gap"]["joint_tolerance"] == pytest.approx(0.02 * np.hypot(2.02, np.sqrt(2)))


def test_contradictions_between_joints_and_physics_are_found() -> None:
    joints = np.array([[0, 1]], dtype=np.int32)
    physics = {"components": 1, "floating": 0, "rooted": True, "stable": True, "margin": 0.5, "weakest": -1}
    shape = Shape((), Assembly(np.zeros(2, np.int16), np.tile(np.eye(4), (2, 1, 1)), joints), "y", ())

    def faults(pairs: np.ndarray = joints, dropped: bool = False, **changed: object) -> list[str]:
        arrays = {CONTACTS: np.empty((2, 0), np.int32), JOINTS: pairs.T}
        record = {"parts": [{}, {}], "physics": {**physics, **changed}}
        sections = {"validity": ValidityConfig(falls=dropped).model_dump()}
        return list(AUDIT.faults(PackagedSample("key", record, {}, arrays, shape, sections)))

    assert faults() == []
    assert faults(components=2) == ["its joints do not make as many components as physics says"]
    assert faults(joints[:0]) == ["its joints do not make as many components as physics says"]
    assert faults(rooted=False) == ["its json says rooted: False and counts 0 floating parts"]
    assert faults(stable=False) == ["its json says stable: False, with a margin of 0.5 for a push of 0.01"]
    assert faults(joints[:, ::-1]) == [f"{JOINTS} holds entries that are not pairs of its parts"]
    assert faults(joints.astype(np.int64)) == [f"{JOINTS} is not an array int32 (2, m)"]
    upright: dict[str, Any] = {"falls": False, "fall_degrees": 20.0, "fallen": 0}
    assert faults(dropped=True, **upright) == []
    leaning = faults(dropped=True, **{**upright, "fall_degrees": 5.0})
    assert leaning == ["its json says falls: False, with a tilt of 5.0 degrees"]
    assert faults(dropped=True, **{**upright, "fallen": 2}) == ["its json names a fallen part that does not exist"]


@pytest.mark.parametrize("friction", [-0.1, 11.0])
def test_friction_out_of_range_is_a_mistake(friction: float) -> None:
    with pytest.raises(ValueError, match="friction"):
        ValidityConfig(friction=friction)
