"""The differentiable interpreter: the same corners, and the right gradients."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from stages.shapeassembly import ProgramError, execute, parse
from stages.shapeassembly.execution.differentiable import DifferentiableProgram
from stages.shapeassembly.execution.parameters import parameter_ranges, parameters, with_parameters
from stages.shapeassembly.syntax.program import AssemblyProgram
from tests.stages.shapeassembly.shared_programs import CATEGORIES, needs_shared, shared_texts
from tests.stages.shapeassembly.strategies import programs


def difference(program: AssemblyProgram) -> float:
    """How far the corners of the two interpreters are apart; gradients must be finite."""
    values = torch.tensor(parameters(program), requires_grad=True)
    corners = DifferentiableProgram(program).corners(values)
    corners.square().sum().backward()  # type: ignore[no-untyped-call]
    assert values.grad is not None
    assert torch.isfinite(values.grad).all()
    expected = execute(program).corners
    assert corners.shape == expected.shape
    return float(np.abs(corners.detach().numpy() - expected).max(initial=0))


@settings(deadline=None, max_examples=60)
@given(programs(depth=3))
def test_both_interpreters_agree(program: AssemblyProgram) -> None:
    assert difference(program) < 1e-8


@needs_shared
@pytest.mark.parametrize("category", CATEGORIES)
def test_both_interpreters_agree_on_real_programs(category: str) -> None:
    for text in list(shared_texts(category).values())[::40]:
        assert difference(parse(text)) < 1e-5


HEAD = """Assembly P { bbox = Cuboid(2.1, 1.9, 2.3, True)
a = Cuboid(0.5, 0.6, 0.7, True) b = Cuboid(0.11, 0.9, 0.13, False)
attach(a, bbox, 0.52, 0.0, 0.47, 0.21, 0.03, 0.33) """
FREE = HEAD + "attach(b, bbox, 0.5, 0.0, 0.4, 0.8, 0.02, 0.7) "
TWO = FREE + "attach(b, a, 0.5, 1.0, 0.6, 0.9, 0.8, 0.7) "


@pytest.mark.parametrize(
    "text",
    [
        FREE,
        FREE + "c = Cuboid(0.31, 0.23, 0.13, True) attach(c, bbox, 0.4, 0.0, 0.3, 0.95, 0.01, 0.9) "
        "attach(c, a, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6) ",
        TWO,
        TWO + "attach(b, bbox, 0.9, 0.4, 0.3, 0.9, 0.5, 0.1) ",
        TWO + "attach(b, bbox, 0.9, 0.4, 0.3, 0.9, 0.5, 0.1) attach(b, bbox, 0.1, 0.6, 0.3, 0.2, 0.5, 0.4) ",
        "Assembly P { bbox = Cuboid(2.0, 2.1, 2.2, True) b = Cuboid(0.2, 1.9, 0.4, False) "
        "attach(b, bbox, 0.5, 0.02, 0.5, 0.5, 0.03, 0.5) attach(b, bbox, 0.5, 0.97, 0.5, 0.52, 0.95, 0.5) "
        "attach(b, bbox, 1.0, 0.5, 0.5, 0.9, 0.5, 0.7) ",
        FREE + "c = Cuboid(1.0, 1.1, 0.9, False) attach(c, bbox, 0.1, 0.0, 0.0, 0.1, 0.0, 0.1) "
        "attach(c, bbox, 1.0, 0.9, 1.0, 0.2, 0.02, 0.12) ",
        FREE + "c = Cuboid(1.0, 0.1, 0.12, False) attach(c, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) "
        "attach(c, bbox, 1.0, 1.0, 1.0, 0.01, 0.0, 0.0) ",
        HEAD + "squeeze(b, bbox, a, top, 0.31, 0.42) ",
        TWO + "reflect(b, X) reflect(a, Z) ",
        TWO + "translate(a, X, 2, 0.41) translate(b, Z, 1, 0.23) ",
    ],
)
def test_gradients_agree_with_finite_differences(text: str) -> None:
    program = parse(text + "}")
    own = DifferentiableProgram(program)
    values = torch.tensor(parameters(program), requires_grad=True)
    assert torch.autograd.gradcheck(own.corners, (values,), eps=1e-6, atol=1e-5)
    assert difference(program) < 1e-10


def test_gradients_reach_through_mirrored_and_stretched_assemblies() -> None:
    text = """Assembly P { bbox = Cuboid(2.0, 2.1, 2.2, True) Q = Cuboid(0.4, 0.5, 0.6, False)
    attach(Q, bbox, 0.5, 0.0, 0.5, 0.2, 0.02, 0.3) attach(Q, bbox, 0.5, 1.0, 0.5, 0.3, 0.8, 0.4) reflect(Q, X) }
    Assembly Q { bbox = Cuboid(0.35, 0.5, 0.7, True) leaf = Cuboid(0.1, 0.2, 0.3, True)
    attach(leaf, bbox, 0.4, 0.0, 0.5, 0.1, 0.0, 0.5) }"""
    program = parse(text)
    own = DifferentiableProgram(program)
    assert torch.autograd.gradcheck(own.corners, (torch.tensor(parameters(program), requires_grad=True),), atol=1e-5)
    assert difference(program) < 1e-10


def test_parameters_that_cannot_be_executed_raise() -> None:
    own = DifferentiableProgram(parse(HEAD + "}"))
    values = torch.tensor(parameters(parse(HEAD + "}"))) * 1e12
    with pytest.raises(ProgramError, match="too far"):
        own.corners(values)


@given(programs())
def test_parameters_round_trip(program: AssemblyProgram) -> None:
    values = parameters(program)
    assert with_parameters(program, values) == program
    low, high = parameter_ranges(program)
    assert ((low <= values) & (values <= high)).all()
    for wrong in (values[:-1], [*values, 0.5]):
        with pytest.raises(ValueError, match="values"):
            with_parameters(program, np.array(wrong))
