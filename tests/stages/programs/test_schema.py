"""The schema: canonical values, and values as text, vectors and classes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.programs.parameters import Parameter, ParameterError, binary, continuous, discrete
from stages.programs.schema import Schema
from tests.stages.programs.stool import PROGRAM

SCHEMA = PROGRAM.schema

grid_values = st.fixed_dictionaries(
    {parameter.name: st.sampled_from(parameter.values) for parameter in PROGRAM.parameters}
)
any_values = st.fixed_dictionaries(
    {
        parameter.name: st.floats(float(parameter.values[0]), float(parameter.values[-1]))
        if parameter.kind == "continuous"
        else st.sampled_from(parameter.values)
        for parameter in PROGRAM.parameters
    }
)


@given(any_values)
def test_text_round_trip_gives_canonical_values(values: dict[str, float]) -> None:
    canonical, _ = SCHEMA.canonical(values)
    assert SCHEMA.from_text(SCHEMA.to_text(values)) == canonical


@given(any_values)
def test_vector_round_trip_gives_canonical_values(values: dict[str, float]) -> None:
    canonical, _ = SCHEMA.canonical(values)
    back = SCHEMA.from_vector([float(value) for value in canonical.values()])
    assert back == canonical
    assert [type(value) for value in back.values()] == [float, float, bool, float]


@given(grid_values)
def test_classes_round_trip_gives_canonical_values(values: dict[str, float]) -> None:
    canonical, _ = SCHEMA.canonical(values)
    classes = SCHEMA.to_classes(values)
    assert SCHEMA.from_classes(classes) == canonical
    np.testing.assert_array_equal(SCHEMA.to_classes(SCHEMA.from_classes(classes)), classes)


@given(st.tuples(*(st.integers(0, parameter.classes - 1) for parameter in PROGRAM.parameters)))
def test_values_of_any_classes_are_stable(classes: tuple[int, ...]) -> None:
    values = SCHEMA.from_classes(classes)
    assert SCHEMA.from_classes(SCHEMA.to_classes(values)) == values


def test_hidden_parameter_has_the_last_class_its_base_and_no_text() -> None:
    values = {"height": 0.3, "scale x": 0.4, "has_rail": False, "rail_height": 0.6}
    assert SCHEMA.to_classes(values).tolist() == [0, 0, 0, 6]
    assert SCHEMA.canonical(values)[0]["rail_height"] == 0.3
    assert SCHEMA.to_text(values) == '{"height":0.3,"scale x":0.4,"has_rail":false}'


def test_hidden_parameter_counts_as_its_base() -> None:
    schema = Schema(
        (
            binary("inner", True, "g", ".", visible_if="middle"),
            binary("middle", False, "g", ".", visible_if="outer"),
            binary("outer", True, "g", "."),
        )
    )
    _, visible = schema.canonical({"inner": True, "middle": True, "outer": False})
    assert visible == {"outer"}
    _, visible = schema.canonical({"inner": True, "middle": True, "outer": True})
    assert visible == {"inner", "middle", "outer"}


@given(st.lists(any_values, min_size=1, max_size=5))
def test_canonical_columns_are_the_canonical_values(shapes: list[dict[str, float]]) -> None:
    columns = np.array([[float(values[name]) for values in shapes] for name in SCHEMA.by_name])
    canonical, visible = SCHEMA.canonical_columns(columns)
    for column, values in enumerate(shapes):
        expected, shown = SCHEMA.canonical(values)
        assert SCHEMA.from_vector(canonical[:, column]) == expected
        rows = zip(SCHEMA.by_name, visible[:, column], strict=True)
        assert {name for name, is_visible in rows if is_visible} == shown


def test_value_has_the_nearest_class() -> None:
    assert SCHEMA.to_classes({**SCHEMA.base, "height": 0.44})[0] == 1
    assert SCHEMA.to_classes({**SCHEMA.base, "height": 0.46})[0] == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"height": 2.0, "scale x": 0.4, "has_rail": false}', "height: 2.0 is out of range; it may be 0.3 to 1.0"),
        ('{"height": "x", "scale x": 0.4, "has_rail": false}', "height: 'x' is out of range; it may be 0.3 to 1.0"),
        ('{"height": true, "scale x": 0.4, "has_rail": false}', "height: True is out of range"),
        ('{"height": NaN, "scale x": 0.4, "has_rail": false}', "height: nan is out of range"),
        ('{"height": 0.5, "scale x": 0.4, "has_rail": 0.5}', "has_rail: 0.5 is out of range; it may be false or true"),
        ('{"hieght": 0.5}', r"no parameter 'hieght'; did you mean height \(0.3 to 1.0\)"),
        ('{"height": 0.5, "scale x": 0.4, "has_rail": true}', "rail_height is missing; it may be 0.1 to 0.6"),
        ("[1, 2]", "JSON object"),
        ("{", "JSON object"),
    ],
)
def test_wrong_text_is_refused_with_parameter_and_range(text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        SCHEMA.from_text(text)


def test_zero_has_one_text() -> None:
    schema = Schema((continuous("lean", -1, 1, 3, 0, "g", "."),))
    assert schema.to_text(schema.from_text('{"lean": -0.0}')) == '{"lean":0.0}'


def test_wrong_classes_and_vectors_are_refused() -> None:
    with pytest.raises(ParameterError, match="rail_height: class 7 is not in 0 to 6"):
        SCHEMA.from_classes([0, 0, 0, 7])
    with pytest.raises(ParameterError, match="3 classes for 4 parameters"):
        SCHEMA.from_classes([0, 0, 0])
    with pytest.raises(ParameterError, match="a vector of 2 numbers for 4 parameters"):
        SCHEMA.from_vector([0.5, 0.5])
    with pytest.raises(ParameterError, match=r"scale x: 3\.0 is out of range; it may be 0\.4 to 1\.1"):
        SCHEMA.from_vector([0.5, 3.0, 0, 0.3])


def test_values_have_the_type_of_their_kind() -> None:
    count = discrete("count", 3, 8, 5, "g", ".")
    assert count.checked(4.0) == 4
    assert type(count.checked(np.float64(4.0))) is int
    assert json.dumps(binary("flag", False, "g", ".").checked(1)) == "true"
    with pytest.raises(ParameterError, match=r"count: 4\.5 is out of range; it may be 3, 4, 5, 6, 7, 8"):
        count.checked(4.5)


def test_invalid_schema_is_refused() -> None:
    height: Parameter = continuous("height", 0, 1, 3, 0, "g", ".")
    with pytest.raises(ValueError, match="one name"):
        Schema((height, height))
    with pytest.raises(ValueError, match="visible by wdith, which is no parameter"):
        Schema((continuous("height", 0, 1, 3, 0, "g", ".", visible_if="wdith > 0"),))
    with pytest.raises(ValueError, match="cyclic"):
        Schema((binary("a", True, "g", ".", visible_if="b"), binary("b", True, "g", ".", visible_if="a")))
    with pytest.raises(ParameterError, match="height: 2 is out of range"):
        continuous("height", 0, 1, 3, 2, "g", ".")
