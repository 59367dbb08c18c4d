"""Conditions mean what they mean in Python, for numbers and for arrays."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stages.programs.conditions import Condition

TEXTS = [
    "( not a ) and ( not b or not c )",
    "( a and b ) or ( not a )",
    "a > 0 and b == 1",
    "( a == 2 ) or ( a == 1 and b == 1 )",
    "a - b >= 0.1",
    "a and ( not b or c < 0.4 )",
    "2 * a + b != c",
]


@pytest.mark.parametrize("text", TEXTS)
def test_condition_means_what_it_means_in_python(text: str) -> None:
    condition = Condition(text)
    for a, b, c in itertools.product([0, 1, 2, 0.35], repeat=3):
        values = {"a": a, "b": b, "c": c}
        assert condition.holds(values) == bool(eval(text, {}, values))


@pytest.mark.parametrize("text", TEXTS)
def test_condition_holds_elementwise_for_arrays(text: str) -> None:
    rows = np.array(list(itertools.product([0, 1, 2, 0.35], repeat=3)))
    columns = dict(zip("abc", rows.T, strict=True))
    expected = [bool(eval(text, {}, dict(zip("abc", row, strict=True)))) for row in rows.tolist()]
    np.testing.assert_array_equal(Condition(text).holds(columns), expected)


def test_names_are_in_order_of_first_mention() -> None:
    assert Condition("b > 1 and (a or b)").names == ("b", "a")


@pytest.mark.parametrize(
    "text", ["__import__('os')", "a.b", "a < b < c", "a[0]", "'x' == a", "a ** 2", "(a and b) + 1", "a and", ""]
)
def test_invalid_condition_is_refused_with_its_text(text: str) -> None:
    with pytest.raises(ValueError, match="condition"):
        Condition(text)
