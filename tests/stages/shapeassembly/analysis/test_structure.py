"""Tokens, signatures and distances see structure alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.programs.structure_clusters import captured_shares
from stages.shapeassembly import parse
from stages.shapeassembly.analysis.edit_distance import edit_distance
from stages.shapeassembly.analysis.statistics import program_statistics
from stages.shapeassembly.analysis.structure import block_signatures, program_distance, signature, tokens
from stages.shapeassembly.execution.parameters import parameters, with_parameters
from stages.shapeassembly.syntax.program import AssemblyProgram
from tests.stages.shapeassembly.execution.test_interpreter import renamed
from tests.stages.shapeassembly.strategies import programs

TEXT = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True)
a = Cuboid(0.5, 0.5, 0.5, True) Q = Cuboid(0.5, 0.5, 0.5, False)
attach(a, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) squeeze(Q, bbox, a, top, 0.5, 0.5) reflect(a, X) translate(Q, Z, 2, 0.5) }
Assembly Q { bbox = Cuboid(0.5, 0.5, 0.5, True) }"""


def test_tokens_of_a_program() -> None:
    assert " ".join(tokens(parse(TEXT))) == (
        "{ Cuboid True Cuboid False { } attach 1 0 squeeze 2 0 1 top reflect 1 X translate 2 2 Z }"
    )


@settings(deadline=None)
@given(programs())
def test_signature_ignores_names_and_numbers(program: AssemblyProgram) -> None:
    assert signature(renamed(program)) == signature(program)
    other = with_parameters(program, parameters(program) * 0.5)
    assert signature(other) == signature(program)
    assert program_distance(other, program) == 0


def test_a_change_of_structure_changes_the_signature() -> None:
    changed = [
        TEXT.replace(*change) for change in [("top", "bot"), (", X)", ", Y)"), ("Z, 2", "Z, 3"), ("False", "True")]
    ]
    assert len({signature(parse(text)) for text in [TEXT, *changed]}) == 5
    assert [program_distance(parse(TEXT), parse(text)) for text in changed] == [1, 1, 1, 1]
    assert program_distance(parse(TEXT), parse(TEXT.replace("reflect(a, X)", ""))) == 3


def test_block_signatures_ignore_what_expands_cuboids() -> None:
    alike = TEXT + TEXT.replace("P", "R").replace("Q {", "S {").replace("Q", "S").split("\nAssembly S")[0]
    digests = block_signatures(parse(alike + "\nAssembly S { bbox = Cuboid(0.5, 0.5, 0.5, True) }"))
    assert (digests[0], digests[1]) == (digests[2], digests[3])
    assert digests[0] != digests[1]
    flat = block_signatures(parse(TEXT.split("\nAssembly Q")[0]))
    assert flat[0] != digests[0]


WORDS = st.lists(st.integers(0, 3), max_size=8)


@given(WORDS, WORDS)
def test_edit_distance_matches_the_textbook(a: list[int], b: list[int]) -> None:
    table = [[i + j if not i * j else 0 for j in range(len(b) + 1)] for i in range(len(a) + 1)]
    for i, x in enumerate(a, 1):
        for j, y in enumerate(b, 1):
            table[i][j] = min(table[i - 1][j] + 1, table[i][j - 1] + 1, table[i - 1][j - 1] + (x != y))
    assert edit_distance(np.array(a, dtype=np.int64), np.array(b, dtype=np.int64)) == table[-1][-1]


def test_statistics_and_clusters_of_few_programs() -> None:
    found = program_statistics([parse(TEXT), parse("Assembly E { bbox = Cuboid(1.0, 1.0, 1.0, True) }")])
    assert (found.programs, found.lines, found.leaf_parts) == (2, 4.5, 1.0)
    assert (found.reflects, found.translates, found.squeezes, found.macros) == (1 / 9, 1 / 9, 1 / 9, 3 / 9)
    assert captured_shares("abbcbc") == pytest.approx([50, 500 / 6, 100])
