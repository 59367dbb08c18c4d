"""Check that a sketch is a drawing of this shape by this camera."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.views.camera_record import pixel_rays, projected

INK_SHARE_RANGE = (2e-4, 0.9)
"""Minimum and maximum share of ink, relative to a black picture."""
MAX_ROTATION_ERROR = 1e-9
"""Largest deviation of a camera's rotation from orthogonality."""
RAYS_ACROSS = 112
"""Number of rays across the picture with which the shape is tested."""
FINE_RAY_SPACING_PIXELS = 0.25
"""Spacing of rays near ink where no ray has hit the shape."""
MIN_OUTLINE_DRAWN = 0.75
"""Minimum share of the outline that has ink."""
MAX_INK_ASTRAY = 0.02
"""Maximum share of the ink that lies off the shape."""


def sketch_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each drawing that cannot be read, is blank, or does not show the shape where its camera sees
    it.
    """
    corners = np.array(list(itertools.product(*np.transpose(sample.record["bounds"]))))
    for index, camera in enumerate(sample.record.get("sketches", ())):
        name = f"sketch{index}.png"
        for fault in _drawing_faults(sample.members[name], camera, corners, sample):
            yield f"{name} {fault}"


def _drawing_faults(
    content: bytes, camera: Mapping[str, Any], corners: FloatArray, sample: PackagedSample
) -> Iterator[str]:
    """Yield what is wrong with one drawing of a sample.

    corners: of the sample's bounding box, float64 (8, 3)
    """
    from PIL import Image

    pose = np.array(camera["world_to_camera"])
    turn = pose[:3, :3]
    if (
        np.abs(turn @ turn.T - np.eye(3)).max() > MAX_ROTATION_ERROR
        or np.linalg.det(turn) < 0
        or pose[3].tolist() != [0, 0, 0, 1]
    ):
        yield "has a camera whose world_to_camera is not a rigid transform"
    if (camera["intrinsics"][0][0] < 0) != camera["flipped"]:
        yield "has a camera whose intrinsics contradict flipped"
    try:
        drawing = np.asarray(Image.open(io.BytesIO(content)))
    except (OSError, SyntaxError, ValueError) as error:
        yield f"cannot be read: {error}"
        return
    if drawing.dtype != np.uint8 or drawing.shape != (camera["height"], camera["width"]):
        yield f"has pixels {drawing.dtype} {drawing.shape}, not those of its record"
        return
    share = 1.0 - float(drawing.mean()) / 255.0
    if not INK_SHARE_RANGE[0] <= share <= INK_SHARE_RANGE[1]:
        yield f"is blank or full: {share:.2%} of it is ink"
        return
    seen = projected(camera, corners)
    # A corner of the box may be behind the camera although no part of the shape is.
    if np.isfinite(seen).all():
        rows, columns = np.nonzero(drawing < 255)
        ink = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
        beyond = max(float((seen.min(axis=0) - ink[0]).max()), float((ink[1] - seen.max(axis=0)).max()))
        if beyond > camera["line_width"] / 2 + 1.0:
            yield f"has ink where its camera does not see the shape, {beyond:.0f} pixels beyond"
            return
    yield from _outline_faults(drawing < 255, camera, sample)


def _outline_faults(inked: npt.NDArray[np.bool_], camera: Mapping[str, Any], sample: PackagedSample) -> Iterator[str]:
    outline_drawn, astray = outline_shares(inked, camera, sample)
    if outline_drawn < MIN_OUTLINE_DRAWN:
        yield f"draws {outline_drawn:.0%} of the outline that its camera sees"
    if astray > MAX_INK_ASTRAY:
        yield f"has {astray:.0%} of its ink where its camera does not see the shape"


def outline_shares(
    inked: npt.NDArray[np.bool_], camera: Mapping[str, Any], sample: PackagedSample
) -> tuple[float, float]:
    """Return the share of the visible outline that has ink near it, and the share of the ink that lies off the shape.

    inked: where there is ink, bool (h, w)
    """
    from scipy.ndimage import binary_erosion, distance_transform_edt

    step = max(1, -(-max(inked.shape) // RAYS_ACROSS))
    rows, columns = (np.arange(step // 2, length, step) for length in inked.shape)
    origins, directions = pixel_rays(camera, columns + 0.5, rows + 0.5)
    hit = sample.rays.hit(origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(len(rows), len(columns))
    if not hit.any():
        return 0.0, 1.0
    near = camera["line_width"] / 2 + 1.5 * step
    outline = hit & ~binary_erosion(hit, border_value=0)
    to_ink = distance_transform_edt(~inked)[np.ix_(rows, columns)]
    seen = np.zeros(inked.shape, dtype=bool)
    seen[np.ix_(rows, columns)] = hit
    off = np.argwhere(inked & (distance_transform_edt(~seen) > near + step))
    astray = sum(not _is_seen_near(pixel, near, camera, sample) for pixel in off)
    return float((to_ink[outline] <= near).mean()), astray / int(inked.sum())


def _is_seen_near(pixel: npt.NDArray[np.int64], near: float, camera: Mapping[str, Any], sample: PackagedSample) -> bool:
    """Return whether the shape is seen `near` a pixel, with rays dense enough for thin parts.

    place: row and column of the pixel, (2,)
    """
    offsets = np.arange(-near, near + FINE_RAY_SPACING_PIXELS, FINE_RAY_SPACING_PIXELS)
    origins, directions = pixel_rays(camera, pixel[1] + 0.5 + offsets, pixel[0] + 0.5 + offsets)
    return bool(sample.rays.hit(origins.reshape(-1, 3), directions.reshape(-1, 3)).any())


AUDIT = Audit(faults=sketch_faults)
