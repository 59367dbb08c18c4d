"""Estimates of a stool's parameters, and searches that begin with them."""

from __future__ import annotations

import numpy as np
import pytest

from stages.recovery.cloud_target import cloud_target
from stages.recovery.refinement import refine_estimate
from stages.shape.arrays import FloatArray
from stages.training.recovery.estimate import ParameterEstimate, base_estimate
from tests.stages.recovery.test_recover import STOOL, TALL, cloud_of


def height_estimate() -> ParameterEstimate:
    """Certain that the height is its third value, uncertain whether there is a rail."""
    weights: dict[str, FloatArray] = {parameter.name: np.ones(len(parameter.values)) for parameter in STOOL.parameters}
    height = STOOL.schema.by_name["height"]
    weights["height"] = np.eye(len(height.values))[2]
    weights["has_rail"] = np.array([0.8, 0.2])
    return ParameterEstimate({name: row / row.sum() for name, row in weights.items()})


def surprise_of(**changes: object) -> float:
    height = STOOL.schema.by_name["height"].values
    canonical, _ = STOOL.schema.canonical({**TALL, "height": height[2], "has_rail": False, **changes})  # type: ignore[dict-item]
    flat = STOOL.schema.by_name["scale x"].values
    return height_estimate().surprise(STOOL, {**canonical, "scale x": (float(flat[0]) + float(flat[-1])) / 2.0})


def test_likeliest_value_has_no_surprise() -> None:
    height = STOOL.schema.by_name["height"].values
    assert surprise_of() == pytest.approx(0.0, abs=1e-9)
    assert surprise_of(height=height[3]) == pytest.approx(6.0)  # a step is the root of twelve deviations
    assert surprise_of(height=height[4]) == pytest.approx(24.0)


def test_surprise_of_a_choice_is_its_log_odds() -> None:
    # plus the surprise of the rail's height, which is not in the middle of its range
    with_rail, rail = surprise_of(has_rail=True), STOOL.schema.by_name["rail_height"].values
    values = np.array(rail, dtype=float)
    variance = values.var() + (values[1] - values[0]) ** 2 / 12.0
    assert with_rail == pytest.approx(np.log(4.0) + (0.2 - values.mean()) ** 2 / (2.0 * variance))


def test_impossible_value_has_finite_surprise() -> None:
    certain = ParameterEstimate({**height_estimate().probabilities, "has_rail": np.array([1.0, 0.0])})
    canonical, _ = STOOL.schema.canonical(TALL)
    assert np.isfinite(certain.surprise(STOOL, canonical))


def height_found(surprise_cost: float, chance_distance: float) -> float:
    rng = np.random.default_rng(0)
    target = cloud_target(cloud_of(TALL), rng)
    return float(
        refine_estimate(STOOL, height_estimate(), target, 200, rng, surprise_cost, chance_distance).values["height"]
    )


def test_high_surprise_cost_keeps_the_estimate() -> None:
    likeliest = STOOL.schema.by_name["height"].values[2]
    assert height_found(0.0, 0.0) == pytest.approx(TALL["height"], abs=0.05)
    assert height_found(1e6, 0.0) == pytest.approx(float(likeliest))


def test_distances_below_chance_do_not_differ() -> None:
    likeliest = STOOL.schema.by_name["height"].values[2]
    assert height_found(0.0, 1e6) == likeliest


def test_base_estimate_begins_at_the_base_shape() -> None:
    assert base_estimate(STOOL).values(STOOL) == dict(STOOL.schema.base)
