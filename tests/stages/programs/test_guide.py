"""The guide's lamp is a program as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import yaml

import stages.programs
from pipeline.config import load_config
from pipeline.registry import find_stages
from stages.programs.draws import Share
from stages.programs.program import Program
from stages.programs.sampling import Sampler, all_value_indices
from tests.stages.programs.test_every_program import check

GUIDE = Path(stages.programs.__file__).with_name("GUIDE.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", GUIDE, re.DOTALL)
    assert found
    return found[1]


def test_the_lamp_of_the_guide_keeps_what_programs_promise() -> None:
    space: dict[str, object] = {}
    exec(compile(block("python"), "GUIDE.md", "exec"), space)
    lamp = space["PROGRAM"]
    assert isinstance(lamp, Program)
    sampler, rng = Sampler(lamp, Share(), off_grid=False), np.random.default_rng(3)
    check(lamp, [sampler.find(cell, rng) for cell in all_value_indices(lamp)])


def test_the_config_of_the_guide_is_one(tmp_path: Path) -> None:
    path = tmp_path / "lamps.yaml"
    path.write_text(block("yaml"))
    config = load_config(path, {name: stage.config for name, stage in find_stages().items()}, {})
    assert config.name == yaml.safe_load(block("yaml"))["name"]
