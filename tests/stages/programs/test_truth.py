"""Programs make what they made when the truth files were written; where a change is meant, `python -m
tests.stages.programs.truth` writes them anew, and the commit says what changed."""

from __future__ import annotations

import json
from typing import Any

import pytest

from stages.programs.program import find_program, program_names
from tests.stages.programs.truth import FOLDER, SEEDS, declared, measured, swept

TOLERANCE = 1e-6


def truth(name: str) -> dict[str, Any]:
    described: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text())
    return described


def near(numbers: list[Any]) -> list[Any]:
    return [pytest.approx(each, rel=TOLERANCE, abs=1e-9) if isinstance(each, float) else each for each in numbers]


def test_there_is_a_file_for_each_program_and_no_other() -> None:
    assert {path.stem for path in FOLDER.glob("*.json")} == set(program_names())


@pytest.mark.parametrize("name", program_names())
def test_labels_rules_and_parameters_are_declared_as_they_were(name: str) -> None:
    program, expected = find_program(name), truth(name)
    found = declared(program)
    parameters = expected["declared"].pop("parameters")
    assert list(found["parameters"]) == list(parameters)
    assert found.pop("parameters") == {each: near(row) for each, row in parameters.items()}
    assert found == expected["declared"]
    assert program.schema.to_text(program.schema.base) == expected["shapes"][0]["values"]


@pytest.mark.parametrize("place", range(1 + len(SEEDS)))
@pytest.mark.parametrize("name", program_names())
def test_each_part_has_its_label_its_colour_its_volume_and_its_bounds(name: str, place: int) -> None:
    program, shape = find_program(name), truth(name)["shapes"][place]
    found = measured(program.parts(program.schema.from_text(shape["values"])))
    assert found == [near(part) for part in shape["parts"]]


@pytest.mark.parametrize("place", range(1 + len(SEEDS)))
@pytest.mark.parametrize("name", program_names())
def test_every_value_of_every_parameter_does_what_it_did(name: str, place: int) -> None:
    program, shape = find_program(name), truth(name)["shapes"][place]
    values = program.schema.from_text(shape["values"])
    for parameter, expected in shape["swept"].items():
        assert swept(program, values, parameter) == [near(each) for each in expected], parameter


@pytest.mark.parametrize("name", program_names())
def test_every_parameter_takes_effect_in_one_of_the_shapes(name: str) -> None:
    described = truth(name)
    for parameter in described["declared"]["parameters"]:
        seen = [{tuple(each) for each in shape["swept"][parameter] if each} for shape in described["shapes"]]
        assert any(len(each) > 1 for each in seen), parameter
