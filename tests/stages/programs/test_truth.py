"""Programs build the recorded shapes. After an intended change, `python -m tests.stages.programs.truth` records them
again, and the commit says what changed."""

from __future__ import annotations

import json
from typing import Any

import pytest

from stages.programs.program import find_program, program_names
from tests.stages.programs.truth import FOLDER, SEEDS, by_value, declared, measured

RELATIVE_TOLERANCE = 1e-6


def truth(name: str) -> dict[str, Any]:
    described: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return described


def near(row: list[Any]) -> list[Any]:
    return [
        pytest.approx(entry, rel=RELATIVE_TOLERANCE, abs=1e-9) if isinstance(entry, float) else entry for entry in row
    ]


def test_every_program_has_a_file() -> None:
    assert {path.stem for path in FOLDER.glob("*.json")} == set(program_names())


@pytest.mark.parametrize("name", program_names())
def test_declarations_are_unchanged(name: str) -> None:
    program, expected = find_program(name), truth(name)
    declaration = declared(program)
    parameters = expected["declared"].pop("parameters")
    assert list(declaration["parameters"]) == list(parameters)
    assert declaration.pop("parameters") == {key: near(row) for key, row in parameters.items()}
    assert declaration == expected["declared"]
    assert program.schema.to_text(program.schema.base) == expected["shapes"][0]["values"]


@pytest.mark.parametrize("index", range(1 + len(SEEDS)))
@pytest.mark.parametrize("name", program_names())
def test_parts_are_unchanged(name: str, index: int) -> None:
    program, shape = find_program(name), truth(name)["shapes"][index]
    parts = measured(program.parts(program.schema.from_text(shape["values"])))
    assert parts == [near(part) for part in shape["parts"]]


@pytest.mark.parametrize("index", range(1 + len(SEEDS)))
@pytest.mark.parametrize("name", program_names())
def test_values_have_the_same_effects(name: str, index: int) -> None:
    program, shape = find_program(name), truth(name)["shapes"][index]
    values = program.schema.from_text(shape["values"])
    for parameter, expected in shape["by_value"].items():
        assert by_value(program, values, parameter) == [near(row) for row in expected], parameter


@pytest.mark.parametrize("name", program_names())
def test_every_parameter_takes_effect(name: str) -> None:
    described = truth(name)
    for parameter in described["declared"]["parameters"]:
        results = [{tuple(row) for row in shape["by_value"][parameter] if row} for shape in described["shapes"]]
        assert any(len(distinct) > 1 for distinct in results), parameter
