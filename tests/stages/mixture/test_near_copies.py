"""Which samples of two producers are near copies, and which of them are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.mixture.near_copies import copy_features, near_copy_pairs, unit_clouds
from stages.programs.program import shape_from_parts
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.shape import Shape
from tests.stages.programs import stool


def stool_of(height: float, width: float) -> Shape:
    values = {"height": height, "scale x": width, "has_rail": False, "rail_height": 0.2}
    return shape_from_parts(stool.PROGRAM, stool.build(values))


def scaled_and_turned(shape: Shape) -> Shape:
    turn = np.array([[0.0, 0, 3, 5], [0, 3, 0, 1], [-3, 0, 0, 2], [0, 0, 0, 1]])
    return replace(shape, assembly=replace(shape.assembly, poses=turn @ shape.assembly.poses))


def pairs_of(
    shapes: list[Shape], makers: list[int], splits: list[int], groups: list[int] | None = None
) -> list[tuple[int, int]]:
    rngs = np.random.default_rng(0).spawn(len(shapes))
    clouds = np.array([unit_clouds(shape, rng) for shape, rng in zip(shapes, rngs, strict=True)])
    sides = np.array([np.diff(shape_bounds(shape), axis=0)[0] for shape in shapes])
    extents = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    features, spacings = copy_features(clouds, extents)
    numbers = (np.arange(len(shapes)) if groups is None else np.array(groups), np.array(makers), np.array(splits))
    return list(near_copy_pairs(features, spacings, lambda number: clouds[number, 0], *numbers))


def test_copies_in_other_places_sizes_and_quarter_turns_are_found() -> None:
    low, high = stool_of(0.5, 1.0), stool_of(0.9, 1.0)
    shapes = [low, high, scaled_and_turned(low), stool_of(0.5, 1.5)]
    assert pairs_of(shapes, [0, 0, 1, 1], [0, 0, 1, 1]) == [(0, 2)]


def test_copies_of_one_producer_split_or_group_are_left_to_others() -> None:
    shape = stool_of(0.5, 1.0)
    assert pairs_of([shape, shape], [0, 0], [0, 1]) == []
    assert pairs_of([shape, shape], [0, 1], [1, 1]) == []
    assert pairs_of([shape, shape], [0, 1], [2, 1], groups=[5, 5]) == []
    assert pairs_of([shape, shape], [0, 1], [2, 1]) == [(0, 1)]


def test_a_shard_without_samples_has_no_features() -> None:
    features, spacings = copy_features(np.empty((0, 2, 512, 3), np.float32), np.empty((0, 3)))
    assert (features.shape, spacings.shape) == ((0, 8), (0,))
