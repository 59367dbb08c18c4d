"""The Python example of the room's README runs, and its tables name what exists."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stages.recovery
from stages.programs.program import find_program
from stages.recovery.reading import INPUT_SUFFIXES
from stages.recovery.recover import recover
from stages.recovery.result import RecoveryResult
from stages.training.recovery.surface import sample_points

README = Path(stages.recovery.__file__).with_name("README.md").read_text(encoding="utf-8")
CHAIR = find_program("chair")


def cloud_of_chair(count: int) -> np.ndarray:
    return sample_points(CHAIR.parts(CHAIR.schema.base), count, np.random.default_rng(0))


@pytest.mark.slow
def test_example_recovers_a_scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(example.splitlines()) <= 4
    np.savetxt(tmp_path / "scan.xyz", cloud_of_chair(1000))
    monkeypatch.chdir(tmp_path)
    defined: dict[str, object] = {}
    exec(compile(example, "README.md", "exec"), defined)
    result = defined["result"]
    assert isinstance(result, RecoveryResult)
    assert result.distance < result.base_distance


def test_table_of_results_has_every_key_of_the_json() -> None:
    table = README.partition("The JSON has:")[2].partition("\n\nRecovered")[0]
    keys = {key for row in re.findall(r"(?m)^\| (`.*?) \|", table) for key in re.findall(r"`(\w+)`", row)}
    assert keys == set(recover(cloud_of_chair(200), "chair", up="y", budget=1).as_json())


def test_table_of_inputs_has_every_format() -> None:
    named = {name.lower() for name in re.findall(r"\b[A-Za-z]{3,6}\b", README.partition("## What comes out")[0])}
    aliases = {"jpg": "jpeg", "tif": "tiff"}
    assert {aliases.get(suffix[1:], suffix[1:]) for suffix in INPUT_SUFFIXES} <= named
