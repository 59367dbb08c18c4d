"""The published parameter tables say what this contract can say: kinds, values, classes, visibility, constraints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stages.programs.conditions import Condition
from stages.programs.parameters import Parameter
from stages.programs.program import Constraint, find_program, program_names
from stages.programs.sampling import all_value_indices
from stages.programs.schema import Schema

SHARED = Path(__file__).resolve().parents[4] / "shared" / "geocode"
DOMAINS = ("chair", "vase", "table", "ceiling_lamp")

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="the published tables are not here")


def published(domain: str) -> dict[str, Any]:
    table: dict[str, Any] = json.loads((SHARED / f"params_{domain}.json").read_text())
    return table


def parameter(row: dict[str, Any]) -> Parameter:
    kind = {"Boolean": "binary", "Integer": "discrete"}.get(row["type"], "continuous")
    values = {"binary": (False, True), "discrete": tuple(map(int, row["values"]))}.get(kind, tuple(row["values"]))
    base = min(max(row["base"], values[0]), values[-1])
    rule = row["visible_if"] and Condition(row["visible_if"])
    return Parameter(row["name"], kind, values, base, "all", ".", rule)  # type: ignore[arg-type]


@pytest.mark.parametrize("domain", DOMAINS)
def test_published_table_is_a_schema_of_the_published_size(domain: str) -> None:
    table = published(domain)
    schema = Schema(tuple(parameter(row) for row in table["params"]))
    assert len(schema.parameters) == table["n_params"]
    assert sum(len(each.values) for each in schema.parameters) == table["sum_values"]
    assert sum(each.classes for each in schema.parameters) == table["prediction_vector_length"]


@pytest.mark.parametrize("domain", DOMAINS)
def test_visibility_of_settled_values_is_the_published_visibility(domain: str) -> None:
    table = published(domain)
    schema = Schema(tuple(parameter(row) for row in table["params"]))
    rng = np.random.default_rng(7)
    for _ in range(500):
        raw = {each.name: each.values[rng.integers(len(each.values))] for each in schema.parameters}
        names = {name: value for name, value in raw.items() if name.isidentifier()}
        expected = {
            row["name"] for row in table["params"] if row["visible_if"] is None or eval(row["visible_if"], {}, names)
        }
        settled, visible = schema.canonical(raw)
        assert visible == expected
        assert schema.from_classes(schema.to_classes(raw)) == settled


@pytest.mark.parametrize("domain", DOMAINS)
def test_published_constraints_are_rules(domain: str) -> None:
    table = published(domain)
    names = {row["name"] for row in table["params"]}
    for text in table["constraints"].values():
        assert len(Condition(text).names) == 2
        assert set(Condition(text).names) <= names


@pytest.mark.parametrize("domain", [each for each in DOMAINS if each in program_names()])
def test_a_program_has_the_published_parameters(domain: str) -> None:
    table, program = published(domain), find_program(domain)
    assert 30 * len(all_value_indices(program)) == table["train_size_30_variations"]
    assert 3 * len(all_value_indices(program)) == table["val_or_test_size_3_variations"]
    assert [each.name for each in program.parameters] == [row["name"] for row in table["params"]]
    for each, row in zip(program.parameters, table["params"], strict=True):
        np.testing.assert_allclose(np.array(each.values, dtype=float), row["values"], atol=1e-4, err_msg=each.name)
        assert each.classes == row["n_classes"], each.name
        assert (each.kind == "continuous") == (row["type"] in {"Float", "Vector"}), each.name
        assert float(each.base) == pytest.approx(row["base"], abs=0.01), each.name


@pytest.mark.parametrize("domain", [each for each in DOMAINS if each in program_names()])
def test_a_program_shows_and_constrains_what_is_published(domain: str) -> None:
    table, program = published(domain), find_program(domain)
    theirs = Schema(tuple(parameter(row) for row in table["params"]))
    rules = [Constraint(name, Condition(text), ".") for name, text in table["constraints"].items()]
    rng = np.random.default_rng(8)
    for _ in range(500):
        raw = {each.name: each.values[rng.integers(len(each.values))] for each in program.parameters}
        visible = program.schema.canonical(raw)[1]
        assert visible == theirs.canonical(raw)[1]
        allowed = all(each.condition.holds(raw) for each in rules if visible.issuperset(each.condition.names))
        assert allowed or program.violated(raw)
