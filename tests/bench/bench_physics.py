"""Rooted and stable box furniture: shapes judged per second; peers: trimesh with FCL, and the published metrics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eval.engine.shapes import BOX_FACES, box_shape
from stages.shape.arrays import FloatArray
from stages.shape.physics.boxes import box_corners
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from tests.bench.measure import Measure, rate

AUTHORS_ROOTED, AUTHORS_STABLE = 1 / 0.024, 1 / 0.52
"""Shapes per second of the metrics of shapeassembly's authors, the middle of 16 to 32 ms and of 335 to 710 ms."""


def chair() -> FloatArray:
    """The corners (11, 8, 3) of a chair of boxes, y up."""
    legs = [((x, 0.25, z), (0.03, 0.25, 0.03)) for x in (-0.3, 0.3) for z in (-0.3, 0.3)]
    bars = [((x, 0.15, 0), (0.02, 0.02, 0.28)) for x in (-0.3, 0.3)]
    slats = [((x, 0.8, -0.3), (0.03, 0.26, 0.02)) for x in (-0.2, 0, 0.2)]
    boxes = [*legs, *bars, *slats, ((0, 0.52, 0), (0.35, 0.03, 0.35)), ((0, 1.08, -0.3), (0.35, 0.04, 0.03))]
    centres, halves = (np.array([box[k] for box in boxes], dtype=float) for k in range(2))
    return box_corners(centres, np.tile(np.eye(3), (len(boxes), 1, 1)), halves)


def bench() -> Iterator[Measure]:
    """Each judgement is of a new shape, with all its preparation; the peer only computes distances with FCL."""
    import trimesh

    corners = chair()
    shape, config = box_shape(corners, "y"), PhysicsConfig()

    def rooted() -> int:
        return int(Judge(shape.meshes, shape.up, config).rooted(shape.assembly))

    def validity() -> int:
        return int(Judge(shape.meshes, shape.up, config).validity(shape.assembly).stable)

    def distances() -> int:
        manager = trimesh.collision.CollisionManager()
        bodies = [trimesh.Trimesh(box, BOX_FACES, process=False) for box in corners]
        for index, body in enumerate(bodies):
            manager.add_object(str(index), body)
        for body in bodies:
            manager.min_distance_single(body)
        return 1

    ours = rate(rooted, seconds=0.5)
    yield Measure(
        "physics, rooted, chair of 11 boxes", "shapes", ours, "trimesh with FCL", rate(distances, seconds=0.5)
    )
    yield Measure("physics, rooted, chair of 11 boxes", "shapes", ours, "published metric", AUTHORS_ROOTED, "24 ms")
    ours = rate(validity, seconds=0.5)
    yield Measure("physics, all, chair of 11 boxes", "shapes", ours, "published simulation", AUTHORS_STABLE, "520 ms")
