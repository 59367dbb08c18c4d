"""The programs have the parameters of the published tables: kinds, values, classes, visibility, constraints."""

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

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="the published tables are missing")


def published(domain: str) -> dict[str, Any]:
    table: dict[str, Any] = json.loads((SHARED / f"params_{domain}.json").read_text(encoding="utf-8"))
    return table


def parameter(row: dict[str, Any]) -> Parameter:
    kind = {"Boolean": "binary", "Integer": "discrete"}.get(row["type"], "continuous")
    values = {"binary": (False, True), "discrete": tuple(map(int, row["values"]))}.get(kind, tuple(row["values"]))
    base = min(max(row["base"], values[0]), values[-1])
    condition = row["visible_if"] and Condition(row["visible_if"])
    return Parameter(row["name"], kind, values, base, "all", ".", condition)  # type: ignore[arg-type]


@pytest.mark.parametrize("domain", DOMAINS)
def test_published_table_is_a_schema_of_the_published_size(domain: str) -> None:
    table = published(domain)
    schema = Schema(tuple(parameter(row) for row in table["params"]))
    assert len(schema.parameters) == table["n_params"]
    assert sum(len(known.values) for known in schema.parameters) == table["sum_values"]
    assert sum(known.classes for known in schema.parameters) == table["prediction_vector_length"]


@pytest.mark.parametrize("domain", DOMAINS)
def test_visibility_is_as_published(domain: str) -> None:
    table = published(domain)
    schema = Schema(tuple(parameter(row) for row in table["params"]))
    rng = np.random.default_rng(7)
    for _ in range(500):
        raw = {known.name: known.values[rng.integers(len(known.values))] for known in schema.parameters}
        names = {name: value for name, value in raw.items() if name.isidentifier()}
        expected = {
            row["name"] for row in table["params"] if not row["visible_if"] or eval(row["visible_if"], {}, names)
        }
        canonical, visible = schema.canonical(raw)
        assert visible == expected
        assert schema.from_classes(schema.to_classes(raw)) == canonical


@pytest.mark.parametrize("domain", DOMAINS)
def test_published_constraints_are_conditions(domain: str) -> None:
    table = published(domain)
    names = {row["name"] for row in table["params"]}
    for text in table["constraints"].values():
        assert len(Condition(text).names) == 2
        assert set(Condition(text).names) <= names


@pytest.mark.parametrize("domain", [domain for domain in DOMAINS if domain in program_names()])
def test_program_has_the_published_parameters(domain: str) -> None:
    table, program = published(domain), find_program(domain)
    assert 30 * len(all_value_indices(program)) == table["train_size_30_variations"]
    assert 3 * len(all_value_indices(program)) == table["val_or_test_size_3_variations"]
    assert [own.name for own in program.parameters] == [row["name"] for row in table["params"]]
    for own, row in zip(program.parameters, table["params"], strict=True):
        np.testing.assert_allclose(np.array(own.values, dtype=float), row["values"], atol=1e-4, err_msg=own.name)
        assert own.classes == row["n_classes"], own.name
        assert (own.kind == "continuous") == (row["type"] in {"Float", "Vector"}), own.name
        assert float(own.base) == pytest.approx(row["base"], abs=0.01), own.name


@pytest.mark.parametrize("domain", [domain for domain in DOMAINS if domain in program_names()])
def test_visibility_and_constraints_are_as_published(domain: str) -> None:
    table, program = published(domain), find_program(domain)
    theirs = Schema(tuple(parameter(row) for row in table["params"]))
    constraints = [Constraint(name, Condition(text), ".") for name, text in table["constraints"].items()]
    rng = np.random.default_rng(8)
    for _ in range(500):
        raw = {known.name: known.values[rng.integers(len(known.values))] for known in program.parameters}
        visible = program.schema.canonical(raw)[1]
        assert visible == theirs.canonical(raw)[1]
        allowed = all(
            constraint.condition.holds(raw)
            for constraint in constraints
            if visible.issuperset(constraint.condition.names)
        )
        assert allowed or program.violated(raw)
