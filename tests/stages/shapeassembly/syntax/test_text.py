"""Programs as text: the parser, what it says of mistakes, and the printer."""

from __future__ import annotations

import pytest
from hypothesis import given

from stages.shapeassembly import ProgramError, parse, print_program
from stages.shapeassembly.syntax.limits import MAX_TEXT_CHARACTERS
from stages.shapeassembly.syntax.printer import rounded_program
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Block, Cuboid, Reflect, Squeeze, Translate
from tests.stages.shapeassembly.strategies import programs

TABLE = """Assembly Table {
	bbox = Cuboid(1.0, 0.7, 0.5, True)
	top = Cuboid(1.0, 0.05, 0.5, True)
	leg = Cuboid(0.05, 0.65, 0.05, False)
	attach(top, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
	squeeze(leg, bbox, top, bot, 0.1, 0.5)
	reflect(leg, X)
	translate(leg, Z, 2, 0.25)
}
"""
TREE = AssemblyProgram(
    (
        Block(
            "Table",
            Cuboid("bbox", (1.0, 0.7, 0.5), True),
            (
                Cuboid("top", (1.0, 0.05, 0.5), True),
                Cuboid("leg", (0.05, 0.65, 0.05), False),
                Attach("top", "bbox", (0.5, 1.0, 0.5), (0.5, 1.0, 0.5)),
                Squeeze("leg", "bbox", "top", "bot", 0.1, 0.5),
                Reflect("leg", "X"),
                Translate("leg", "Z", 2, 0.25),
            ),
        ),
    )
)


def test_text_and_tree_are_the_same_program() -> None:
    assert parse(TABLE) == TREE
    assert print_program(TREE) == TABLE


@given(programs())
def test_a_printed_program_reads_back_equal(program: AssemblyProgram) -> None:
    text = print_program(program)
    assert parse(text) == program
    assert print_program(parse(text)) == text


def test_every_number_survives_printing() -> None:
    dims = (0.1 + 0.2, 1e-5, 123456.789)
    program = AssemblyProgram((Block("P", Cuboid("bbox", dims, True), ()),))
    assert parse(print_program(program)) == program
    assert rounded_program(program).root.bbox.dims == (0.3, 0.0, 123456.789)


def test_a_cuboid_without_its_flag_is_not_aligned() -> None:
    text = "Assembly P { bbox = Cuboid(2, 2, 2) c = Cuboid(1, 1, 1) }"
    program = parse(text)
    assert (program.root.bbox.aligned, program.root.cuboids[0].aligned) == (False, False)
    assert parse(print_program(program)) == program


def test_blanks_and_line_ends_do_not_matter() -> None:
    assert parse(" ".join(TABLE.split())) == TREE
    assert parse(TABLE.replace("\n", "\r\n").replace("\t", "    ")) == TREE


HEAD = "Assembly P {\n\tbbox = Cuboid(1.0, 1.0, 1.0, True)\n"


@pytest.mark.parametrize(
    ("text", "reason", "line", "column"),
    [
        ("", "empty", 1, 1),
        ("  \n", "empty", 1, 1),
        ("assembly P {", "syntax", 1, 1),
        ("Assembly {", "syntax", 1, 10),
        ("Assembly P {\n}", "no bounding box", 2, 1),
        (HEAD, "text ends", 2, 36),
        (HEAD + "\tfoo(bbox)\n}", "unknown command", 3, 2),
        (HEAD + "\tc = Cuboid(1.0, 1.0, True)\n}", "syntax", 3, 23),
        (HEAD + "\tc = Cuboid(1.0, 1.0, 1.0, yes)\n}", "syntax", 3, 28),
        (HEAD + "\tc = Cuboid(1.0, nan, 1.0, True)\n}", "syntax", 3, 18),
        (HEAD + "\tc = Cuboid(1.0, 1.0.0, 1.0, True)\n}", "syntax", 3, 18),
        (HEAD + "\tc = Cuboid(1.0, 1e9, 1.0, True)\n}", "number too large", 3, 18),
        (HEAD + "\tc = Cuboid(1.0, 1e999, 1.0, True)\n}", "number too large", 3, 18),
        (HEAD + "\tTrue = Cuboid(1.0, 1.0, 1.0, True)\n}", "syntax", 3, 2),
        (HEAD + "\tattach(c, bbox, 0.5, 0.5, 0.5, 0.5, 0.5)\n}", "syntax", 3, 41),
        (HEAD + "\tattach(c bbox, 0.5)\n}", "syntax", 3, 11),
        (HEAD + "\tsqueeze(c, bbox, bbox, up, 0.5, 0.5)\n}", "syntax", 3, 25),
        (HEAD + "\treflect(c, W)\n}", "syntax", 3, 13),
        (HEAD + "\ttranslate(c, X, 2.5, 0.5)\n}", "syntax", 3, 18),
        (HEAD + "\ttranslate(c, X, 0, 0.5)\n}", "number of copies", 3, 18),
        (HEAD + "\ttranslate(c, X, 1000000, 0.5)\n}", "number of copies", 3, 18),
        (HEAD + "\ttranslate(c, X, " + "9" * 5000 + ", 0.5)\n}", "number of copies", 3, 18),
        (HEAD + "}\nAssembly P {", "name taken", 4, 10),
        (HEAD + "}\nAssembly bbox {", "name taken", 4, 10),
        (HEAD + "}}", "syntax", 3, 2),
        (HEAD + "\t# a remark\n}", "syntax", 3, 2),
        (HEAD + "\tattach(ç, bbox)\n}", "syntax", 3, 9),
    ],
)
def test_syntax_error_states_its_place(text: str, reason: str, line: int, column: int) -> None:
    with pytest.raises(ProgramError) as caught:
        parse(text)
    assert (caught.value.reason, caught.value.line, caught.value.column) == (reason, line, column)


def test_syntax_error_is_shown_with_a_caret() -> None:
    with pytest.raises(ProgramError) as caught:
        parse(HEAD + "\treflect(cube0, W)\n}")
    assert str(caught.value).splitlines() == [
        "line 3, column 17: syntax: 'W' found where an axis, one of X, Y, Z is expected",
        " reflect(cube0, W)",
        " " * 16 + "^",
    ]


def test_overlong_text_is_refused() -> None:
    with pytest.raises(ProgramError, match="too long"):
        parse(" " * (MAX_TEXT_CHARACTERS + 1))
