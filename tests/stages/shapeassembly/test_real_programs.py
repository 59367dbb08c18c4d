"""All published programs are read, printed back, executed; and executed as their authors do."""

from __future__ import annotations

import numpy as np
import pytest

from eval.programs.structure_clusters import captured_shares
from stages.shapeassembly import execute, execute_all, parse, print_program
from stages.shapeassembly.analysis.statistics import program_statistics
from stages.shapeassembly.analysis.structure import block_signatures, signature
from stages.shapeassembly.syntax.checks import overflow, violations
from stages.shapeassembly.syntax.program import AssemblyProgram
from tests.stages.shapeassembly.shared_programs import CATEGORIES, SHARED, needs_shared, shared_texts

pytestmark = needs_shared


@pytest.fixture(scope="module", params=CATEGORIES)
def category(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def programs(category: str) -> list[AssemblyProgram]:
    """All programs of a category, in the order of their texts: of one category at a time, for they are many."""
    return [parse(text) for text in shared_texts(category).values()]


def test_every_program_prints_back_equal_and_is_executed_to_finite_boxes(
    category: str, programs: list[AssemblyProgram]
) -> None:
    texts = shared_texts(category)
    assert len(texts) == CATEGORIES[category]
    assert [print_program(program) for program in programs] == list(texts.values())
    executions = execute_all(programs)
    assert all(len(done) and np.isfinite(done.corners).all() for done in executions)
    # Six chairs ask for attachments that lie much farther apart than their cuboid is long; all others keep inside.
    beyond = [overflow(program, done) for program, done in zip(programs, executions, strict=True)]
    assert sum(item > 0.03 for item in beyond) <= (6 if category == "chair" else 0)


MISSES = {"random_small": 1}
"""One attachment to a cuboid with two prior ones would be turned by 1.7 degrees; the authors leave it as it is."""


@pytest.mark.parametrize("name", ["chair", "table", "storage", "random_flat", "random_hier", "random_small"])
def test_corners_match_the_authors_code(name: str) -> None:
    with np.load(SHARED / f"truth_{name}.npz", allow_pickle=False) as truth:
        texts, corners, nodes, starts = (truth[key] for key in ("program", "part_corners", "part_node", "part_offsets"))
    missed = []
    for index, text in enumerate(texts.tolist()):
        done = execute(parse(text))
        own = slice(starts[index], starts[index + 1])
        assert np.array_equal(done.nodes, nodes[own])
        if np.abs(done.corners - corners[own]).max() > 1e-3:
            missed.append(index)
    assert len(missed) <= MISSES.get(name, 0), missed


PUBLISHED = {
    "chair": (24.4, 0.0090, 0.113, 0.207, 9.7),
    "table": (20.0, 0.0050, 0.145, 0.246, 8.4),
    "storage": (24.7, 0.0147, 0.151, 0.232, 10.8),
}
"""Lines, translates, squeezes, all macros a line, leaf parts (shapeassembly tables 3 and 5, ground truth).

Reflects are left out: the table's 0.0880 for chairs and its total do not agree by 0.003, ours do."""


def test_statistics_match_the_published_ones(category: str, programs: list[AssemblyProgram]) -> None:
    found = program_statistics(programs)
    lines, translates, squeezes, macros, parts = PUBLISHED[category]
    assert found.lines == pytest.approx(lines, abs=0.1)
    assert found.translates == pytest.approx(translates, abs=3e-4)
    assert found.squeezes == pytest.approx(squeezes, abs=1.1e-3)
    assert found.macros == pytest.approx(macros, abs=1.1e-3)
    assert found.leaf_parts == pytest.approx(parts, abs=0.15)


def test_assemblies_share_their_structure_more_than_whole_programs_do() -> None:
    chairs = [parse(text) for text in shared_texts("chair").values()]
    whole = captured_shares([signature(program) for program in chairs])
    parts = captured_shares([block for program in chairs for block in block_signatures(program)])
    assert whole[99] < 35 < 50 < parts[99]
    assert whole[-1] == parts[-1] == pytest.approx(100)


def test_nearly_all_programs_keep_every_rule() -> None:
    texts = [text for category in CATEGORIES for text in shared_texts(category).values()]
    broken = [violation for text in texts[::4] for violation in violations(parse(text))[:1]]
    assert len(broken) < 0.03 * len(texts[::4])
    assert {item.rule for item in broken} <= {"size", "attached twice", "bounding box at its sides"}
