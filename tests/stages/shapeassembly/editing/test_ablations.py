"""Programs in other words: the same shape without macros and in another order, and which turn where none is aligned."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly import Execution, execute, parse
from stages.shapeassembly.editing.ablations import without_alignment, without_macros, without_order
from stages.shapeassembly.syntax.checks import violations
from stages.shapeassembly.syntax.program import Attach, Cuboid
from tests.stages.shapeassembly.shared_programs import CATEGORIES, needs_shared, shared_texts

SHELF = """Assembly P { bbox = Cuboid(2.0, 2.0, 1.0, True)
side = Cuboid(0.1, 2.0, 1.0, True) Drawer = Cuboid(0.6, 0.3, 0.8, True) board = Cuboid(1.8, 0.1, 0.9, True)
squeeze(side, bbox, bbox, top, 0.025, 0.5) attach(board, side, 0.0, 0.5, 0.5, 1.0, 0.1, 0.5)
squeeze(Drawer, side, side, bot, 0.5, 0.5) attach(Drawer, board, 0.2, 0.0, 0.5, 0.2, 1.0, 0.5)
reflect(side, X) translate(board, Y, 3, 0.6) reflect(Drawer, X) }
Assembly Drawer { bbox = Cuboid(0.6, 0.3, 0.8, True) front = Cuboid(0.6, 0.3, 0.1, True)
knob = Cuboid(0.1, 0.05, 0.05, False) attach(front, bbox, 0.5, 0.0, 1.0, 0.5, 0.0, 1.0)
attach(knob, front, 0.5, 0.5, 0.0, 0.2, 0.5, 1.0) translate(knob, X, 1, 0.3) }"""
SHELF = SHELF.replace("squeeze(Drawer, side, side, bot, 0.5, 0.5) ", "")


def same_boxes(one: Execution, other: Execution, tolerance: float) -> bool:
    """Whether each box of one is a box of the other, corners in any order."""
    centres = np.linalg.norm(one.centres[:, None] - other.centres[None], axis=2)
    for row, corners in zip(centres, one.corners, strict=True):
        near = np.flatnonzero(row <= tolerance)
        apart = [
            np.linalg.norm(corners[:, None] - other.corners[item][None], axis=2).min(axis=1).max() for item in near
        ]
        if not apart or min(apart) > tolerance:
            return False
    return len(one) == len(other)


def test_macros_are_expanded_with_mirrored_sub_programs() -> None:
    program = parse(SHELF)
    plain = without_macros(program)
    assert {type(line) for block in plain.blocks for line in block.lines} == {Cuboid, Attach}
    assert len(plain.blocks) == 3
    assert len(plain.root.cuboids) == 8
    assert same_boxes(execute(program), execute(plain), 1e-9)


@needs_shared
@pytest.mark.parametrize("category", CATEGORIES)
def test_real_programs_without_macros_make_the_same_shapes(category: str) -> None:
    texts = list(shared_texts(category).values())[::60]
    same = [same_boxes(execute(program), execute(without_macros(program)), 1e-3) for program in map(parse, texts)]
    assert np.mean(same) >= 0.95


def test_random_order_keeps_the_rules_and_the_parts() -> None:
    program = parse(SHELF)
    texts = set()
    for seed in range(8):
        other = without_order(program, np.random.default_rng(seed))
        assert [violation for violation in violations(other) if violation.rule == "not grounded"] == []
        assert all(set(one.lines) == set(two.lines) for one, two in zip(program.blocks, other.blocks, strict=True))
        assert len(execute(other)) == len(execute(program))
        texts.add(str(other))
    assert len(texts) > 4
    assert without_order(program, np.random.default_rng(1)) == without_order(program, np.random.default_rng(1))


def test_without_alignment_only_the_bounding_boxes_are_aligned() -> None:
    program = without_alignment(parse(SHELF))
    assert all(block.bbox.aligned and not any(cuboid.aligned for cuboid in block.cuboids) for block in program.blocks)
    assert [len(block.lines) for block in program.blocks] == [len(block.lines) for block in parse(SHELF).blocks]
