"""Light for portraits: which ground a picture shows."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from stages.shape.views.camera import Camera
from stages.shape.views.light import ground_seen
from tests.stages.shape.views.solids import boxes_scene


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_the_ground_that_a_pixel_shows_lies_at_its_height_and_is_seen_there(
    kind: Literal["perspective", "orthographic"],
) -> None:
    scene = boxes_scene([(0, 0, 0), (1, 0, 0)], edges=[(0, 1)])
    view = Camera(-35.0, 28.0, kind).look(scene.points, scene.up, 48 / 40)
    wanted = np.zeros((40, 48), dtype=np.bool_)
    wanted[::3, ::5] = True
    pixels, points = ground_seen(wanted, view, 1, -0.5, np.zeros(3), 1e6)
    assert len(pixels) > 50
    assert wanted.reshape(-1)[pixels].all()
    assert points[:, 1] == pytest.approx(-0.5)
    local = points @ view.eye[:3, :3].T + view.eye[:3, 3]
    depth = -local[:, 2] if view.perspective else np.ones(len(local))
    column = (local[:, 0] * view.projection[0, 0] / depth + 1) / 2 * 48
    row = (1 - local[:, 1] * view.projection[1, 1] / depth) / 2 * 40
    assert np.stack([row, column], axis=1) == pytest.approx(np.stack([pixels // 48, pixels % 48], axis=1) + 0.5)


def test_ground_far_from_the_shape_or_over_the_horizon_is_not_asked_for() -> None:
    scene = boxes_scene([(0, 0, 0)])
    everywhere = np.ones((32, 32), dtype=np.bool_)
    flat = Camera(0.0, 0.0).look(scene.points, scene.up)
    pixels, _ = ground_seen(everywhere, flat, 1, -0.5, np.zeros(3), 1e9)
    assert (pixels // 32).min() >= 16
    above = Camera(0.0, 40.0).look(scene.points, scene.up)
    _, points = ground_seen(everywhere, above, 1, -0.5, np.zeros(3), 2.0)
    assert 0 < len(points) < 32 * 32
    assert np.linalg.norm(points, axis=1).max() < 2.0
