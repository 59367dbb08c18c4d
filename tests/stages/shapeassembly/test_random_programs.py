"""Random programs: they keep the rules of the language, differ, nest as deep as allowed, and stand where they must."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.sample import read_samples
from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.random_programs import random_program, random_shards
from stages.shapeassembly.settings import RandomPrograms
from stages.shapeassembly.shape import shape_of_execution
from stages.shapeassembly.syntax.checks import overflow, protruding_parts, violations
from stages.shapeassembly.syntax.printer import print_program
from stages.shapeassembly.syntax.program import AssemblyProgram, Reflect, Squeeze, Translate
from tests.command import shapemill

SOURCE = RandomPrograms(name="random", samples=150)


def levels(program: AssemblyProgram, name: str = "") -> int:
    block = program.named[name] if name else program.root
    inner = [levels(program, cuboid.name) for cuboid in block.cuboids if cuboid.name in program.named]
    return 1 + max(inner, default=0)


def test_random_programs_keep_every_rule_and_nearly_all_stay_in_their_boxes() -> None:
    structures, lines, inside = set(), set(), 0
    for seed in range(60):
        program = random_program(SOURCE, np.random.default_rng(seed))
        assert program == random_program(SOURCE, np.random.default_rng(seed))
        again = parse(print_program(program))
        assert violations(again) == []
        protruding = [part for block in again.blocks for part in protruding_parts(block)]
        inside += not protruding and overflow(again, execute(again)) <= 0.05
        structures.add(signature(program))
        lines.update(type(line) for block in program.blocks for line in block.lines)
        assert levels(program) <= SOURCE.max_levels
    assert inside > 54
    assert len(structures) > 40
    assert {Squeeze, Reflect, Translate} <= lines


def test_depth_is_what_the_config_allows() -> None:
    for most in (1, 2):
        source = RandomPrograms(name="random", samples=1, max_levels=most, expanded=1.0)
        deepest = max(levels(random_program(source, np.random.default_rng(seed))) for seed in range(20))
        assert deepest == most


def test_a_shard_draws_its_own_programs() -> None:
    shards = random_shards("toy", [SOURCE, RandomPrograms(name="more", samples=2)])
    assert [shard.params["count"] for shard in shards] == [64, 64, 22, 2]
    assert [shard.params["first"] for shard in shards] == [0, 64, 128, 0]
    assert len({shard.name for shard in shards}) == 4


@pytest.mark.slow
def test_samples_stand_and_bytes_do_not_depend_on_workers(tmp_path: Path) -> None:
    config = tmp_path / "toy.yaml"
    section = {"random": [{"name": "random", "samples": 70}], "accept": "valid", "splits": {"shards": 1}}
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 4, "shapeassembly": section}), encoding="utf-8")
    made = []
    for workers in (1, 2):
        out = tmp_path / f"out-{workers}"
        code, printed = shapemill("run", "shapeassembly", "--config", config, "--out", out, "--workers", workers)
        assert code == 0, printed
        folder = out / ".work" / "toy" / "shapeassembly"
        made.append({path.name: path.read_bytes() for path in sorted(folder.glob("toy-*.tar"))})
    assert made[0] == made[1]
    samples = [sample for path in sorted(folder.glob("toy-*.tar")) for sample in read_samples(path)]
    assert len(samples) == 70
    for sample in samples[:20]:
        assert unmet_requirement(Requirements(stable=True), shape_of_execution(execute(parse(sample.text)))) is None
