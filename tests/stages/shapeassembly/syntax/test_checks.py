"""Every rule that a well-made program keeps is found out when it is broken, with its line."""

from __future__ import annotations

from typing import get_args

import pytest
from hypothesis import given

from stages.shapeassembly import execute, parse
from stages.shapeassembly.syntax.checks import Rule, overflow, protruding_parts, violations
from stages.shapeassembly.syntax.program import AssemblyProgram
from tests.stages.shapeassembly.strategies import programs

HEAD = "Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) "
TWO = HEAD + "a = Cuboid(0.5, 0.5, 0.5, True) b = Cuboid(0.5, 0.5, 0.5, True) "
ONE = HEAD + "a = Cuboid(0.5, 0.5, 0.5, True) "
DOWN = "attach(a, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) "
NEXT = "attach(b, a, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5) "
EMPTY = "{ bbox = Cuboid(0.5, 0.5, 0.5, True) }"


@pytest.mark.parametrize(
    ("rule", "number", "text"),
    [
        ("name taken", 4, ONE + "a = Cuboid(0.5, 0.5, 0.5, True) " + DOWN + "}"),
        ("unknown name", 5, ONE + DOWN + "attach(a, c, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) }"),
        ("circle", 0, ONE + DOWN + "} Assembly a " + "{ bbox = Cuboid(0.5, 0.5, 0.5, True) " + ONE[48:] + DOWN + "}"),
        ("assembly unused", 0, ONE + DOWN + "} Assembly Q " + EMPTY),
        ("order of lines", 5, ONE + DOWN + "b = Cuboid(0.5, 0.5, 0.5, True) " + NEXT + "}"),
        ("order of lines", 7, TWO + DOWN + "reflect(a, X) " + NEXT + "}"),
        ("bounding box not aligned", 2, (ONE + DOWN + "}").replace("1.0, True", "1.0, False")),
        ("bounding box moved", 5, ONE + DOWN + "attach(bbox, a, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) }"),
        ("bounding box at its sides", 4, ONE + "attach(a, bbox, 0.5, 0.0, 0.5, 0.5, 0.06, 0.5) }"),
        ("bounding box at its sides", 4, ONE + "squeeze(a, bbox, bbox, left, 0.5, 0.5) }"),
        ("attached to itself", 5, ONE + DOWN + "attach(a, a, 0.5, 0.0, 0.5, 0.5, 0.5, 0.5) }"),
        ("attached twice", 5, ONE + DOWN + DOWN + "}"),
        ("attached twice", 7, TWO + DOWN + NEXT + NEXT + "}"),
        ("not grounded", 5, TWO + NEXT + DOWN + "}"),
        ("not grounded", 0, TWO + DOWN + "}"),
        ("not grounded", 6, TWO + DOWN + "reflect(b, X) }"),
        ("size", 3, ONE.replace("0.5, 0.5, 0.5", "0.5, 0.009, 0.5") + DOWN + "}"),
        ("size", 3, ONE.replace("0.5, 0.5, 0.5", "0.5, 1.11, 0.5") + DOWN + "}"),
        ("range", 4, ONE + DOWN.replace("0.5, 0.5)", "0.5, 1.001)").replace("0.0, 0.5)", "0.0, 1.001)") + "}"),
        ("range", 4, ONE + "squeeze(a, bbox, bbox, top, -0.1, 0.5) }"),
        ("range", 5, ONE + DOWN + "translate(a, X, 2, 1.5) }"),
        (
            "too many cuboids",
            0,
            HEAD
            + "".join(f"a{n} = Cuboid(0.5, 0.5, 0.5, True) " for n in range(11))
            + "".join(f"squeeze(a{n}, bbox, bbox, top, 0.5, 0.5) " for n in range(11))
            + "}",
        ),
    ],
)
def test_a_broken_rule_is_named_with_its_line(rule: str, number: int, text: str) -> None:
    found = [(violation.rule, violation.number) for violation in violations(parse(text))]
    assert (rule, number) in found
    assert {item for item, _ in found} - {rule} <= {"not grounded", "attached twice"}


def test_every_rule_has_a_case() -> None:
    [cases] = test_a_broken_rule_is_named_with_its_line.pytestmark  # type: ignore[attr-defined]
    assert {case[0] for case in cases.args[1]} == set(get_args(Rule))


def test_top_and_bottom_of_the_bounding_box_can_both_be_attached_to() -> None:
    assert violations(parse(ONE + DOWN + "attach(a, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5) }")) == []
    assert violations(parse(ONE + "squeeze(a, bbox, bbox, top, 0.5, 0.5) }")) == []


@given(programs())
def test_programs_of_the_grammar_keep_every_rule(program: AssemblyProgram) -> None:
    assert violations(program) == []


def test_overflow_is_a_share_of_the_bounding_box() -> None:
    inside = parse(ONE + DOWN + "}")
    assert overflow(inside, execute(inside)) == 0
    outside = parse(ONE + "attach(a, bbox, 0.5, 0.0, 0.5, 1.0, 0.0, 0.5) }")
    assert overflow(outside, execute(outside)) == pytest.approx(0.25)


@pytest.mark.parametrize(("x", "beyond"), [(0.83, []), (0.87, ["c", "cube1"])])
def test_cuboids_and_copies_may_reach_out_of_their_assembly_by_a_tenth(x: float, beyond: list[str]) -> None:
    """The box is 1 wide, the cuboid 0.5: its side comes to x + 0.25."""
    text = f"""Assembly P {{ bbox = Cuboid(1.0, 1.0, 1.0, True) c = Cuboid(0.5, 0.5, 0.5, True)
    attach(c, bbox, 0.5, 0.0, 0.5, {x}, 0.0, 0.5) reflect(c, X) }}"""
    assert protruding_parts(parse(text).root) == beyond
