"""The viewpoint of a picture: the one from which most of a shape's parts are seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.scene import Scene

AZIMUTHS = (-40.0, 40.0, -140.0, 140.0)
"""Degrees; the first of equally good ones is taken, from the left of what formats call the front."""
ELEVATIONS = (25.0, 50.0)
"""Degrees; the lower of equally good ones is taken."""
MIN_GAIN = 1.1
"""Factor by which another viewpoint must show more than the best of those before it."""
IMAGE_PIXELS = 96
MAX_SCENES_SEEN = 4


def best_viewpoint(scenes: Sequence[Scene], camera: Camera) -> Camera:
    """Return `camera` at the azimuth and elevation from which it sees most of `scenes`.

    Of the first MAX_SCENES_SEEN scenes, each in a frame that it fills, the square roots of the pixels of each part are
    added up: many parts count for more than one large one, so a shelf is seen from its open side, a cabinet from its
    doors, and a flat layout from above. The answer depends on the scenes only.
    """
    best, most = camera, 0.0
    for elevation, azimuth in product(ELEVATIONS, AZIMUTHS):
        candidate = replace(camera, azimuth=azimuth, elevation=elevation)
        seen = sum(_seen(scene, candidate) for scene in scenes[:MAX_SCENES_SEEN])
        if seen > (MIN_GAIN if most else 1.0) * most:
            best, most = candidate, seen
    return best


def _seen(scene: Scene, camera: Camera) -> float:
    """Return the sum over the parts of the square roots of their pixels, as a share of what one part can have."""
    visible = visible_triangles(scene, camera, (IMAGE_PIXELS, IMAGE_PIXELS), "raster").triangles
    parts = scene.triangle_part[visible[visible >= 0]]
    return float(np.sqrt(np.bincount(parts, minlength=len(scene))).sum()) / IMAGE_PIXELS
