"""What falls here falls in MuJoCo and in PyBullet, on shapes that are far from the border."""

from __future__ import annotations

import pytest

from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape, upright
from tests.bench.engine_falls import ENGINES
from tests.stages.shape.geometry.bodies import box
from tests.stages.shape.physics.structures import solid


def tower(width: float) -> Shape:
    """A tower of height 1."""
    return solid(box(width, width, 1.0, at=(0.0, 0.0, 0.5)))


def stool(*lengths: float) -> Shape:
    """A seat at height 1 on legs of these lengths at its corners."""
    places = ((-0.45, -0.45), (0.45, -0.45), (-0.45, 0.45), (0.45, 0.45))
    legs = [box(0.1, 0.1, length, at=(x, y, 1 - length / 2)) for length, (x, y) in zip(lengths, places, strict=True)]
    return solid(box(1.0, 1.0, 0.1, at=(0.0, 0.0, 1.05)), *legs)


def overhang(reach: float) -> Shape:
    """A plate that reaches beyond its foot."""
    return solid(box(0.4, 0.4, 1.0, at=(0.0, 0.0, 0.5)), box(2.0, 0.4, 0.2, at=(reach, 0.0, 1.1)))


CASES = {
    "broad tower": (tower(0.3), False),
    "narrow tower": (tower(0.06), True),
    "tower that a push throws over": (tower(0.085), True),
    "tower that bears the push": (tower(0.125), False),
    "stool": (stool(1.0, 1.0, 1.0, 1.0), False),
    "stool with a shorter leg": (stool(1.0, 1.0, 1.0, 0.985), False),
    "stool with two short legs": (stool(1.0, 1.0, 0.7, 0.7), True),
    "plate above its foot": (overhang(0.0), False),
    "plate off its foot": (overhang(0.8), True),
    "cube and a thin wall apart": (
        solid(box(1.0, 1.0, 1.0, at=(0.0, 0.0, 0.5)), box(0.04, 1.0, 1.0, at=(3.0, 0.0, 0.5))),
        True,
    ),
}


@pytest.mark.parametrize("engine", ["MuJoCo", "PyBullet"])
@pytest.mark.parametrize("name", CASES)
def test_the_dropping_test_and_the_engines_agree(name: str, engine: str) -> None:
    if engine not in ENGINES:
        pytest.skip(f"{engine} is not installed")
    shape, expected = upright(CASES[name][0]), CASES[name][1]
    judge = Judge(shape.meshes, shape.up, PhysicsConfig())
    joints = judge.validity(shape.assembly).joints
    assert judge.fall(shape.assembly, joints).falls == expected
    assert ENGINES[engine](shape, joints) == expected
