"""Check that the images of a view agree with each other, and with the shape that its camera sees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.arrays import BoolArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.views.camera_record import pixel_rays
from stages.views.reading import SampleView, read_views

RAYS_ACROSS = 64
"""Number of rays across an image with which the shape is tested."""
MAX_DEPTH_ERROR = 2e-3
"""Largest error of a depth, in lengths of the shape."""
MAX_NORMAL_ERROR_DEGREES = 1.0
MAX_STRAY_SHARE = 0.03
"""Maximum share of rays, away from silhouettes, that meet something else than the images show."""


def view_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each image that cannot be read, has another size, or contradicts another."""
    if "views" not in sample.record:
        return
    classes = np.array([part["class"] for part in sample.record["parts"]])
    try:
        views = read_views(sample.members, sample.record["views"])
    except ValueError as error:
        yield f"its views cannot be read: {error}"
        return
    for index, view in enumerate(views):
        for fault in _image_faults(view, classes):
            yield f"view {index} {fault}"


def _image_faults(view: SampleView, classes: np.ndarray) -> Iterator[str]:
    size = (view.camera["height"], view.camera["width"])
    for kind, image in view.images.items():
        if image.shape[:2] != size:
            yield f"has {kind} of {image.shape[:2]} pixels, not {size}"
            return
    shown = {kind: seen for kind, image in view.images.items() if (seen := _seen(kind, image)) is not None}
    for kind, seen in shown.items():
        if not seen.any():
            yield f"has {kind} that show nothing"
            return
    first = next(iter(shown), None)
    for kind, seen in shown.items():
        if first is not None and (seen != shown[first]).any():
            yield f"shows other pixels in {kind} than in {first}"
    if "instances" in view.images:
        if view.instances.max() >= len(classes):
            yield "shows parts that the record does not have"
        elif "classes" in view.images and (_classes_of(view, classes) != view.classes).any():
            yield "has classes that are not those of its parts"
    alpha = view.color[..., 3] if "color" in view.images and view.color.shape[2] == 4 else None
    if alpha is not None and first is not None and _inner(shown[first] & (alpha == 0)).any():
        yield f"has no colour where {first} shows the shape"


def _inner(pixels: BoolArray) -> BoolArray:
    """Return the pixels with all their neighbours, bool (h, w).

    Colour is the mean of samples around the centre of a pixel, and all else is taken at the centre: what is thinner
    than a pixel may be missed by either, but not in a whole neighbourhood.
    """
    from scipy.ndimage import minimum_filter

    inner: BoolArray = minimum_filter(pixels, 3)
    return inner


def _classes_of(view: SampleView, classes: np.ndarray) -> np.ndarray:
    """Return the class of the part that each pixel shows, (h, w), -1 for none."""
    return np.where(view.instances >= 0, classes[view.instances], -1)


def _seen(kind: str, image: np.ndarray) -> BoolArray | None:
    """Return where an image shows the shape, bool (h, w); None for images that do not say."""
    if kind == "depth":
        return np.asarray(image > 0)
    if kind == "normals":
        return np.asarray(image.any(axis=-1))
    if kind in ("instances", "classes"):
        return np.asarray(image >= 0)
    return image if kind == "mask" else None


def recheck_views(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield a sentence for each view whose depth, normals or parts are not those that rays meet."""
    cameras = sample.record.get("views", [])
    normals_space = sample.sections.get("views", {}).get("normals_space", "camera")
    for index, view in enumerate(read_views(sample.members, cameras)):
        for fault in _ray_faults(view, sample, normals_space):
            yield f"view {index} {fault}"


def _ray_faults(view: SampleView, sample: PackagedSample, normals_space: str) -> Iterator[str]:
    shown = next((seen for kind, image in view.images.items() if (seen := _seen(kind, image)) is not None), None)
    if shown is None:
        return
    step = max(1, -(-max(shown.shape) // RAYS_ACROSS))
    rows, columns = (np.arange(step // 2, length, step) for length in shown.shape)
    origins, directions = pixel_rays(view.camera, columns + 0.5, rows + 0.5)
    distance, triangle = sample.rays.first_hits(origins.reshape(-1, 3), directions.reshape(-1, 3))
    distance, triangle = distance.reshape(len(rows), -1), triangle.reshape(len(rows), -1)
    grid = np.ix_(rows, columns)
    inner = _away_from_edges(view)[grid]
    hit = triangle >= 0
    wrong: Mapping[str, np.ndarray] = {"a shape": (shown[grid] != hit) & inner}
    both = shown[grid] & hit & inner
    if "depth" in view.images:
        wrong = {**wrong, "depth": both & (np.abs(view.depth[grid] - distance) > MAX_DEPTH_ERROR * sample.size)}
    if "instances" in view.images:
        part = sample.rays.triangles[1][triangle]
        wrong = {**wrong, "parts": both & (view.instances[grid] != part)}
    if "normals" in view.images:
        corners = sample.rays.triangles[0][triangle]
        expected = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
        if normals_space == "camera":
            expected = expected @ np.array(view.camera["world_to_camera"])[:3, :3].T
        length = np.linalg.norm(expected, axis=-1)
        cosine = np.abs((expected * view.normals[grid]).sum(axis=-1)) / np.where(length > 0, length, 1.0)
        turned = cosine < np.cos(np.radians(MAX_NORMAL_ERROR_DEGREES))
        wrong = {**wrong, "normals": both & turned}
    for what, pixels in wrong.items():
        share = pixels.sum() / max(int(shown[grid].sum()), 1)
        if share > MAX_STRAY_SHARE:
            yield f"shows {what} that rays do not meet, at {share:.0%} of its pixels"


def _away_from_edges(view: SampleView) -> BoolArray:
    """Return the pixels whose neighbours show the same part, bool (h, w)."""
    from scipy.ndimage import maximum_filter, minimum_filter

    parts = view.images.get("instances", view.images.get("classes"))
    if parts is None:
        parts = _seen(*next((kind, image) for kind, image in view.images.items() if _seen(kind, image) is not None))
    numbers = np.asarray(parts).astype(np.int32)
    same: BoolArray = maximum_filter(numbers, 3) == minimum_filter(numbers, 3)
    return same


AUDIT = Audit(faults=view_faults, recheck=recheck_views)
