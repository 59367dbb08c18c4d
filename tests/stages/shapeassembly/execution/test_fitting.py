"""Fitting finds the parameters that a point cloud was made with, and keeps them in range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stages.shape.geometry.clouds import chamfer_l1
from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.execution.fitting import fit, fit_cuboids, sampled_surface_points
from stages.shapeassembly.execution.parameters import parameter_ranges, parameters, with_parameters
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import execution_boxes

CHAIR = parse(Path("datasets/exemplars/programs/chair-slats.txt").read_text(encoding="utf-8"))


def test_perturbed_chair_is_fitted_back() -> None:
    rng = np.random.default_rng(4)
    points = sampled_surface_points(execute(CHAIR), 3000, rng)
    low, high = parameter_ranges(CHAIR)
    values = parameters(CHAIR)
    start = with_parameters(CHAIR, np.clip(values + rng.normal(0, 0.05, len(values)) * (high > low), low, high))
    done = fit(start, points, rng, steps=80, samples=800)
    floor = chamfer_l1(sampled_surface_points(execute(CHAIR), 800, rng), points)
    assert done.before > 1.5 * floor
    assert done.after < 1.15 * floor
    assert signature(done.program) == signature(CHAIR)
    low, high = parameter_ranges(start)
    assert ((low <= parameters(done.program)) & (parameters(done.program) <= high)).all()


def test_free_cuboids_are_fitted_independently() -> None:
    """Moved, turned and too thick, and back: what was attached need not be so any more."""
    rng = np.random.default_rng(4)
    wanted = execution_boxes(execute(CHAIR))
    points = sampled_surface_points(execute(CHAIR), 3000, rng)
    turn = Rotation.from_rotvec([0.05, 0.1, 0.0]).as_matrix()
    moved = [Box(item.center + rng.normal(0, 0.03, 3), 1.1 * item.size, item.axes @ turn) for item in wanted]
    found = fit_cuboids(moved, points, rng, steps=120, samples=800)
    apart = [
        np.mean([np.abs(a.center - b.center) for a, b in zip(value, wanted, strict=True)]) for value in (moved, found)
    ]
    assert apart[1] < 0.6 * apart[0]
    for item in found:
        np.testing.assert_allclose(item.axes @ item.axes.T, np.eye(3), atol=1e-9)
    with pytest.raises(ValueError, match="no cuboids"):
        fit_cuboids([], points, rng)


def test_surface_points_lie_on_all_faces_by_area() -> None:
    done = execute(parse("Assembly P { bbox = Cuboid(4.0, 4.0, 4.0, True) c = Cuboid(1.0, 2.0, 3.0, True) }"))
    points = sampled_surface_points(done, 6000, np.random.default_rng(0)) / done.sizes[0]
    on_face = np.abs(np.abs(points) - 0.5) < 1e-12
    assert on_face.any(axis=1).all()
    assert np.abs(points).max() <= 0.5 + 1e-12
    # Faces across x are 2 x 3, across y 1 x 3, across z 1 x 2.
    assert on_face.mean(axis=0) == pytest.approx(np.array([6, 3, 2]) / 11, abs=0.03)


def test_the_same_seed_fits_the_same() -> None:
    points = sampled_surface_points(execute(CHAIR), 500, np.random.default_rng(0)) * [1.0, 0.9, 1.0]
    first, second = (fit(CHAIR, points, np.random.default_rng(1), steps=5, samples=200) for _ in range(2))
    assert (first.program, first.after) == (second.program, second.after)


def test_fit_without_points_or_parts_raises() -> None:
    empty = parse("Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) }")
    with pytest.raises(ValueError, match="no points"):
        fit(CHAIR, np.empty((0, 3)), np.random.default_rng(0))
    with pytest.raises(ValueError, match="no parts"):
        fit(empty, np.zeros((1, 3)), np.random.default_rng(0))
