"""Programmes of one body: the same answers as a general solver, degenerate contacts included."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from stages.shape.physics.tableau import grow_loads

LOAD = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def on_the_ground(points: np.ndarray, friction: float = 0.7, sides: int = 8) -> np.ndarray:
    """What friction forces at points relative to the centre of mass do to a body, (6, c)."""
    angles = 2 * np.pi * np.arange(sides) / sides
    forces = np.stack([friction * np.cos(angles), friction * np.sin(angles), np.ones(sides)], axis=1)
    edges = [np.concatenate([force, np.cross(point, force)]) for point in points for force in forces]
    return np.stack(edges, axis=1)


def by_highs(edges: np.ndarray, load: np.ndarray, growing: np.ndarray, cap: float) -> float:
    """The greatest factor, if there is equilibrium at 0 to begin with."""
    if cap > 0 and by_highs(edges, load, growing, 0.0) < 0:
        return -1.0
    costs = np.r_[np.zeros(edges.shape[1]), -1.0]
    bounds = [(0, None)] * edges.shape[1] + [(0, cap)]
    solved = linprog(costs, A_eq=np.column_stack([edges, growing]), b_eq=load, bounds=bounds, method="highs")
    return float(solved.x[-1]) if solved.status == 0 else -1.0


def pushes(*ways: tuple[float, float]) -> np.ndarray:
    return np.array([[x, y, 0, 0, 0, 0] for x, y in ways], dtype=float)


def test_a_table_tips_over_its_nearest_side_and_slides_at_the_friction() -> None:
    corners = np.array([[x, y, -1.0] for x in (-0.3, 0.3) for y in (-2.0, 2.0)])
    factors, motions = grow_loads(on_the_ground(corners), LOAD, pushes((1, 0), (0, 1), (0, -1)), 1.0)
    assert factors == pytest.approx([0.3, 0.7, 0.7])
    # it tips about the feet that are pushed towards: no force at a foot can do work that way but upward
    assert (motions[0] @ on_the_ground(corners) >= -1e-9).all()


def test_a_plank_on_its_edge_bears_no_push_and_a_point_bears_none_at_all() -> None:
    edge = np.array([[0, -1.0, -0.5], [0, 1.0, -0.5]])
    factors, _ = grow_loads(on_the_ground(edge), LOAD, pushes((1, 0), (0, 1)), 1.0)
    assert factors == pytest.approx([0.0, 0.7], abs=1e-9)
    factors, _ = grow_loads(on_the_ground(edge[:1]), LOAD, pushes((1, 0), (0, 1)), 1.0)
    assert factors.tolist() == [-1, -1], "the centre of mass is not over the point"
    factors, _ = grow_loads(on_the_ground(np.array([[0, 0, -0.5]])), LOAD, pushes((1, 0)), 1.0)
    assert factors == pytest.approx([0.0], abs=1e-9)


def test_the_cap_is_the_most() -> None:
    corners = np.array([[x, y, -0.1] for x in (-1, 1) for y in (-1, 1)])
    factors, motions = grow_loads(on_the_ground(corners), LOAD, pushes((1, 0)), 0.25)
    assert factors.tolist() == [0.25]
    assert not motions.any()


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 12), flat=st.booleans(), grid=st.booleans())
def test_factors_are_those_of_a_general_solver(seed: int, count: int, flat: bool, grid: bool) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (count, 3)) - [0, 0, 1]
    if flat:
        points[:, 2] = -1
    if grid:  # equal ratios and points in a line
        points = np.round(points * 2) / 2
    edges = on_the_ground(points, friction=float(rng.uniform(0, 1.5)), sides=int(rng.integers(3, 24)))
    growing = rng.normal(size=(5, 6))
    growing[:2, 2:] = 0
    factors, multipliers = grow_loads(edges, LOAD, growing, 1.0)
    assert factors == pytest.approx([by_highs(edges, LOAD, load, 1.0) for load in growing], abs=2e-6)
    for factor, multiplier, load in zip(factors, multipliers, growing, strict=True):
        if 0 <= factor < 1:  # the certificate: a way to move in which no force does harm and the load works
            assert (multiplier @ edges >= -1e-6).all()
            assert multiplier @ load == pytest.approx(1.0, abs=1e-6)
            assert multiplier @ LOAD == pytest.approx(factor, abs=1e-5)
