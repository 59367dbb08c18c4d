"""Programs as numbers, and batches of the assemblies of a level."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly import ProgramError, parse
from stages.training.program_vae.batches import ProgramCorpus, batch_of, batches
from stages.training.program_vae.lines import (
    ALIGNED,
    AXIS,
    COMMAND,
    COPIES,
    DIMS,
    FACE,
    INDICES,
    LINE_WIDTH,
    POINTS,
    STOP,
    TRANSLATE,
    UV,
    assembly_lines,
)

STOOL = """Assembly P { bbox = Cuboid(1.0, 1.2, 0.8, True)
Legs = Cuboid(0.9, 0.5, 0.7, True) top = Cuboid(0.4, 0.1, 0.3, False)
attach(Legs, bbox, 0.5, 0.0, 0.5, 0.4, 0.0, 0.6)
squeeze(top, bbox, Legs, top, 0.3, 0.7)
translate(top, X, 3, 0.25) reflect(top, Z) }
Assembly Legs { bbox = Cuboid(0.9, 0.5, 0.7, True)
leg = Cuboid(0.1, 0.5, 0.1, True)
attach(leg, bbox, 0.5, 0.0, 0.5, 0.1, 0.0, 0.1) reflect(leg, X) }"""
BOX = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) c = Cuboid(0.5, 0.5, 0.5, True)
attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) }"""


def test_line_vector_sets_only_the_numbers_of_its_command() -> None:
    root, legs = assembly_lines(parse(STOOL))
    assert root.numbers.shape == (7, LINE_WIDTH)
    cuboid, _, attach, squeeze, translate, reflect, stop = root.numbers
    np.testing.assert_allclose(cuboid[DIMS], [0.9, 0.5, 0.7])
    assert (cuboid[ALIGNED][0], root.numbers[1][ALIGNED][0], cuboid.sum()) == (1, 0, pytest.approx(4.1))
    assert attach[INDICES].nonzero()[0].tolist() == [1, 11]
    np.testing.assert_allclose(attach[POINTS], [0.5, 0.0, 0.5, 0.4, 0.0, 0.6])
    assert squeeze[INDICES].nonzero()[0].tolist() == [2, 11, 23]
    assert squeeze[FACE].argmax() == 2
    np.testing.assert_allclose(squeeze[UV], [0.3, 0.7])
    assert (translate[TRANSLATE], translate[AXIS].argmax()) == (1, 0)
    np.testing.assert_allclose(translate[COPIES], [0.3, 0.25])
    assert (reflect[AXIS].argmax(), reflect[COPIES].sum()) == (2, 0)
    assert stop.nonzero()[0].tolist() == [STOP]
    assert root.children.tolist() == [1, -1, -1, -1, -1, -1, -1]
    assert (legs.parent, legs.line, legs.box.tolist()) == (0, 0, [0.9, 0.5, 0.7])


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("reflect(c, X) reflect(cube1, Z)", "names a copy"),
        (" ".join(f"d{k} = Cuboid(0.1, 0.1, 0.1, True)" for k in range(10)), "too many cuboids"),
    ],
)
def test_program_without_line_vectors_is_rejected(line: str, reason: str) -> None:
    with pytest.raises(ProgramError) as caught:
        assembly_lines(parse(BOX[:-1] + line + "}"))
    assert caught.value.reason == reason


def test_levels_hold_assemblies_of_one_depth_with_their_parents() -> None:
    programs = ProgramCorpus.of([assembly_lines(parse(text)) for text in (BOX, STOOL)])
    roots, below = batch_of(programs, np.array([1, 0]))
    assert roots.lengths.tolist() == [7, 3]
    assert not roots.lines[1, 3:].any()
    assert len(roots.places) == sum(roots.counts) == 10
    commands = roots.lines.flatten(0, 1)[roots.places, COMMAND].argmax(dim=-1).tolist()
    assert commands == sorted(commands)
    assert [commands.count(number) for number in range(7)] == list(roots.counts)
    assert below.parents.tolist() == [[0, 0]]
    assert roots.expanded.tolist() == [True, False, False]
    assert roots.opened.tolist() == [0]
    np.testing.assert_allclose(roots.sizes[0, :3], [[1.0, 1.2, 0.8], [0.9, 0.5, 0.7], [0.4, 0.1, 0.3]])
    assert roots.before[0, 0].nonzero().flatten().tolist() == [0]
    assert (roots.before[:, 1:] == roots.lines[:, :-1]).all()


def test_epoch_has_every_program_once_and_arrays_round_trip() -> None:
    programs = ProgramCorpus.of([assembly_lines(parse(text)) for text in (BOX, STOOL, BOX, STOOL, BOX)])
    sizes = [len(levels[0].lines) for levels in batches(programs, 2, np.random.default_rng(0))]
    assert sorted(sizes) == [1, 2, 2]
    again = ProgramCorpus.of_arrays(programs.arrays())
    assert all(
        np.array_equal(one, other) for one, other in zip(vars(programs).values(), vars(again).values(), strict=True)
    )
