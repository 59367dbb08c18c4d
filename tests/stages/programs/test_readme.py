"""The examples of the room's README: its program is a valid one, and its commands exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import stages.programs
from stages.programs.commands import PROGRAMS
from stages.programs.draws import Share
from stages.programs.program import Program
from stages.programs.sampling import Sampler, all_value_indices
from tests.stages.programs.test_every_program import check

README = Path(stages.programs.__file__).with_name("README.md").read_text(encoding="utf-8")
(LAMP,) = re.findall(r"The whole program:\n\n```python\n(.*?)```", README, re.DOTALL)


def test_example_program_keeps_the_guarantees_of_programs() -> None:
    defined: dict[str, object] = {}
    exec(compile(LAMP, "README.md", "exec"), defined)
    lamp = defined["PROGRAM"]
    assert isinstance(lamp, Program)
    sampler, rng = Sampler(lamp, Share(), off_grid=False), np.random.default_rng(3)
    check(lamp, [sampler.find(value_index, rng) for value_index in all_value_indices(lamp)])


def test_example_commands_exist() -> None:
    known = {command.callback.__name__ for command in PROGRAMS.registered_commands if command.callback}
    lines = re.findall(r"(?m)^\.venv/bin/shapemill programs (.*?)(?: +#.*)?$", README)
    assert {shlex.split(line)[0] for line in lines} == known - {"inspect"}


def test_example_draws_a_chair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (example,) = re.findall(r"A chair from its parameters:\n\n```python\n(.*?)```", README, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert (tmp_path / "chair.png").read_bytes().startswith(b"\x89PNG")
