"""What a network believes of a stool, and what its search makes of it."""

from __future__ import annotations

import numpy as np
import pytest

from stages.recovery.cloud_target import cloud_target
from stages.recovery.refinement import refine
from stages.shape.arrays import FloatArray
from stages.training.recovery.estimate import ParameterEstimate, base_estimate
from tests.stages.recovery.test_recover import STOOL, TALL, cloud_of


def believed() -> ParameterEstimate:
    """Sure that the height is the third value, and of two minds whether there is a rail."""
    chances: dict[str, FloatArray] = {each.name: np.ones(len(each.values)) for each in STOOL.parameters}
    height = STOOL.schema.by_name["height"]
    chances["height"] = np.eye(len(height.values))[2]
    chances["has_rail"] = np.array([0.8, 0.2])
    return ParameterEstimate({name: each / each.sum() for name, each in chances.items()})


def surprised(**changes: object) -> float:
    height = STOOL.schema.by_name["height"].values
    settled, _ = STOOL.schema.canonical({**TALL, "height": height[2], "has_rail": False, **changes})  # type: ignore[dict-item]
    flat = STOOL.schema.by_name["scale x"].values
    return believed().surprise(STOOL, {**settled, "scale x": (float(flat[0]) + float(flat[-1])) / 2.0})


def test_the_likeliest_surprises_least() -> None:
    height = STOOL.schema.by_name["height"].values
    assert surprised() == pytest.approx(0.0, abs=1e-9)
    assert surprised(height=height[3]) == pytest.approx(6.0)  # a step is the root of twelve deviations
    assert surprised(height=height[4]) == pytest.approx(24.0)


def test_a_choice_surprises_by_how_much_less_likely_it_is() -> None:
    # and what comes into view with it, where it is not in the middle
    with_rail, rail = surprised(has_rail=True), STOOL.schema.by_name["rail_height"].values
    places = np.array(rail, dtype=float)
    spread = places.var() + (places[1] - places[0]) ** 2 / 12.0
    assert with_rail == pytest.approx(np.log(4.0) + (0.2 - places.mean()) ** 2 / (2.0 * spread))


def test_a_value_that_is_held_impossible_is_only_unlikely() -> None:
    certain = ParameterEstimate({**believed().probabilities, "has_rail": np.array([1.0, 0.0])})
    settled, _ = STOOL.schema.canonical(TALL)
    assert np.isfinite(certain.surprise(STOOL, settled))


def found_height(prior: float, near: float) -> float:
    rng = np.random.default_rng(0)
    target = cloud_target(cloud_of(TALL), rng)
    return float(refine(STOOL, believed(), target, 200, rng, prior, near).values["height"])


def test_a_search_that_trusts_the_guess_stays_with_it() -> None:
    likeliest = STOOL.schema.by_name["height"].values[2]
    assert found_height(0.0, 0.0) == pytest.approx(TALL["height"], abs=0.05)
    assert found_height(1e6, 0.0) == pytest.approx(float(likeliest))


def test_what_is_near_enough_is_not_made_nearer() -> None:
    likeliest = STOOL.schema.by_name["height"].values[2]
    assert found_height(0.0, 1e6) == likeliest


def test_who_knows_nothing_begins_with_the_base_shape() -> None:
    assert base_estimate(STOOL).values(STOOL) == dict(STOOL.schema.base)
