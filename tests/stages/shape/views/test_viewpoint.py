"""Viewpoints: the open side of a shelf, the doors of a cabinet, a flat layout from above."""

from __future__ import annotations

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from stages.shape.views.camera import Camera
from stages.shape.views.scene import Scene, scene_of
from stages.shape.views.viewpoint import best_viewpoint
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose, with_arrow

USUAL = Camera(azimuth=-40.0, elevation=25.0)
PARTS = {"block": box(2, 2, 2), "knob": with_arrow(box(0.4, 0.4, 0.1)), "tile": box(1, 0.1, 1)}


def scene(shape: list[Placed]) -> Scene:
    kit: Kit = kit_of(PARTS, [shape])
    assembly: Assembly = kit.exemplars[0].assembly
    return scene_of(kit_shape(kit, assembly))


def knobs(z: float, turns: int = 0) -> list[Placed]:
    return [("knob", pose(x, y, z, turns)) for x in (-0.6, 0.0, 0.6) for y in (-0.6, 0.0, 0.6)]


def test_shape_that_looks_alike_from_all_sides_has_the_usual_view() -> None:
    assert best_viewpoint([scene([("block", pose(0, 0, 0)), ("block", pose(0, 2, 0))])], USUAL) == USUAL


def test_view_is_on_the_side_with_most_parts() -> None:
    block: Placed = ("block", pose(0, 0, 0))
    front = best_viewpoint([scene([block, *knobs(1.05)])], USUAL)
    back = best_viewpoint([scene([block, *knobs(-1.05, 2)])], USUAL)
    assert abs(front.azimuth) < 90 < abs(back.azimuth)
    assert (back.fov, back.margin) == (USUAL.fov, USUAL.margin)


def test_flat_layout_is_seen_from_above() -> None:
    floor = [("tile", pose(x, 0, z)) for x in range(6) for z in range(6)]
    assert best_viewpoint([scene(floor)], USUAL).elevation == 50.0


def test_several_scenes_share_one_view() -> None:
    block: Placed = ("block", pose(0, 0, 0))
    front, back = scene([block, *knobs(1.05)]), scene([block, *knobs(-1.05, 2)])
    assert abs(best_viewpoint([front, front, back], USUAL).azimuth) < 90
    assert np.isfinite(best_viewpoint([back], USUAL).azimuth)
