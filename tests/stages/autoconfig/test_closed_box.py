"""Closed boxes are distinguished from open shapes and from boxes with something protruding."""

from __future__ import annotations

import numpy as np
import pytest

from stages.autoconfig.closed_box import is_closed_box, side_shares
from stages.autoconfig.resize_fallback import estimate_resizing
from stages.shape.shape import Shape, kit_shape
from tests.stages.proportions.stools import kit as stools
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

PANELS = {
    "lid": box(2, 0.1, 1),
    "side": box(0.1, 0.8, 1),
    "back": box(1.8, 0.8, 0.1),
    "board": box(1.8, 0.1, 0.8),
    "handle": box(0.4, 0.1, 0.05),
}
WITHOUT_FRONT: list[Placed] = [
    ("lid", pose(0, 0.45, 0)),
    ("lid", pose(0, -0.45, 0)),
    ("side", pose(-0.95, 0, 0)),
    ("side", pose(0.95, 0, 0)),
    ("back", pose(0, 0, -0.45)),
    ("board", pose(0, 0, 0)),
]


def whole(placed: list[Placed]) -> Shape:
    kit = kit_of(PANELS, [placed])
    return kit_shape(kit, kit.exemplars[0].whole)


@pytest.mark.parametrize(
    ("more", "closed"),
    [
        ([("back", pose(0, 0, 0.45))], True),
        (
            [("back", pose(0, 0, 0.45)), ("handle", pose(0, 0, 0.525))],
            True,
        ),  # a door with a handle, which hides the board
        ([("back", pose(0, 0, 0.45)), ("handle", pose(0, 0, 0.525)), ("handle", pose(1.025, 0, 0, 1))], False),
    ],
)
def test_closed_box_may_have_one_side_with_something_on_it(more: list[Placed], closed: bool) -> None:
    assert is_closed_box(whole([*WITHOUT_FRONT, *more])) == closed


def test_side_shares_are_those_of_the_box_around_a_shape() -> None:
    front, right, back, left, top, bottom = side_shares(whole(WITHOUT_FRONT))
    np.testing.assert_allclose([right, back, left, top, bottom], 1.0)
    # of 2 x 1 the edges of two lids and two sides
    assert front == pytest.approx((2 * 2 * 0.1 + 2 * 0.1 * 0.8) / 2, abs=0.03)


def test_resized_closed_box_is_reported_to_look_alike() -> None:
    others = {"floor": box(2, 0.12, 1), "wall": box(0.12, 0.8, 1), "front": box(1.8, 0.8, 0.12)}
    placed = [
        *(WITHOUT_FRONT[number] for number in (0, 2, 4, 5)),
        ("floor", pose(0, -0.46, 0)),
        ("wall", pose(0.96, 0, 0)),
        ("front", pose(0, 0, 0.46)),
    ]
    kit = kit_of(PANELS | others, [placed])  # no two sides are congruent, so it has no bays
    assert "look alike, since the exemplar is a closed box with plain sides" in estimate_resizing(kit, 2).sentence
    assert "alike" not in estimate_resizing(stools(), 2).sentence
