"""The sampler refuses and counts shapes without the required properties."""

from __future__ import annotations

import numpy as np
import pytest

from stages.programs.draws import Share
from stages.programs.program import build_shape, find_program
from stages.programs.sampling import Sampler
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig, Requirements

OVERHANG = find_program("tests.stages.programs.overhang")


@pytest.mark.parametrize("physics", [PhysicsConfig(push=0.0), PhysicsConfig(push=0.02)])
def test_only_stable_shapes_are_kept_and_others_counted(physics: PhysicsConfig) -> None:
    sampler = Sampler(OVERHANG, Share(), off_grid=False, require=Requirements(stable=True, physics=physics))
    rng = np.random.default_rng(7)
    kept = [sampler.find(None, rng) for _ in range(20)]
    shapes = [build_shape(OVERHANG, values) for values in kept]
    assert all(Judge(shape.meshes, shape.up, physics).validity(shape.assembly).stable for shape in shapes)
    # the plate weighs as much as the post; they fall once their common middle is beyond the foot of the post
    assert max(values["reach"] for values in kept) <= 0.4
    assert sampler.refused["any", "not stable"] > 0


def test_properties_that_are_not_required_are_not_checked() -> None:
    sampler = Sampler(OVERHANG, Share(), off_grid=False, require=Requirements(rooted=True))
    rng = np.random.default_rng(7)
    kept = [sampler.find(None, rng) for _ in range(20)]
    assert max(values["reach"] for values in kept) > 0.4
    assert not any(reason.startswith("not") for _, reason in sampler.refused)
