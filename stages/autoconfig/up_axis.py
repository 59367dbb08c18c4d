"""Which axis points up in some models: the files' own word, else what their shapes and the format's custom say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from pipeline.randomness import decision_rng
from stages.exemplars.identify import IdentifiedParts
from stages.exemplars.model import Model
from stages.points.area_sampling import sample_surface
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import rotation_angle, transform_points
from stages.shape.geometry.triangles import triangle_areas

FOOT = 0.01
"""What lies below this share of the height is the foot."""
STANDS, FOOT_COUNTS, MIRROR_COUNTS = 0.8, 0.27, 0.19
"""What it counts that a model would fall over along the other axis, that its foot is e times as large as the other, and
that turning it upside down moves its surface e times as far: log odds by which 286 public models tell their axis."""
CUSTOM = 1.0
"""What the custom of a format counts: it says more about household things than their shapes do, of which 73 % tell."""
CUSTOMS: Mapping[str, Literal["y", "z"]] = {".obj": "y", ".stl": "z"}
MOST = 3.0
"""No ratio counts more than this power of e."""
FLOOR_FOOT, FLOOR_MIRROR = 3e-3, 2e-3
"""Feet and distances below these shares of a model's size (squared, of feet) are noise."""
SURE = 0.1
"""From which sum of the counts on they say which axis is up."""
LOOKED_AT = 1500
"""Points of a model that are compared with its mirror image."""
TURNED = 0.05
"""Radians from which on equal parts count as turned against each other."""
ALONG = 0.99
"""Cosine from which on an axis of rotation is one of the axes."""
MAJORITY = 0.75
"""So many of the rotations about y or z must agree."""

_AXES: dict[Literal["y", "z"], int] = {"y": 1, "z": 2}
REASONS = {
    "stands": "along the other axis the middle of a model is not above its foot",
    "foot": "the lowest points span more area than along the other axis",
    "mirror": "along the other axis a model is more like its own mirror image",
    "custom": "it is the custom of the format, and the shape says little else",
}
"""What the axis is told from, each with its sentence."""


def resolve_up_axis(models: Sequence[Model], identified: IdentifiedParts) -> tuple[Literal["y", "z"], str]:
    """The axis that points up in `models`, whose parts are `identified`, and the reason, a sentence.

    A format that lets files choose is believed (COLLADA). glTF calls y up whatever stands in it, and other formats
    say nothing: there four things are weighed. Along which axis would the models not fall over, their middle being
    above their foot, the hull of their lowest points? Along which is the foot larger? Along which are they less
    like their own mirror image, for things have an upper and a lower side more often than a front and a back? What is
    the custom of the format? Where these say nothing it is the axis about which equal parts are turned; else y.
    """
    said = {model.up for model in models}
    if len(said) == 1 and None not in said:
        (word,) = said
        if word is not None:
            return word, "the file says so"
    counts = {reason: float(np.mean([each[reason] for each in map(_evidence, models)])) for reason in REASONS}
    total = sum(counts.values())
    if abs(total) >= SURE:
        sign = 1.0 if total > 0 else -1.0
        strongest = max(REASONS, key=lambda reason: sign * counts[reason])
        return ("y" if sign > 0 else "z"), REASONS[strongest]
    turns = _turns(identified)
    for axis, place in _AXES.items():
        if turns[place] > MAJORITY * (turns[1] + turns[2]):
            return axis, f"equal parts are turned about {axis}, {turns[place]} of {turns[1] + turns[2]} times"
    return "y", "neither the foot nor the turns of equal parts tell, and y is the custom"


def _evidence(model: Model) -> dict[str, float]:
    """What each reason counts for y, and if negative for z."""
    corners = np.concatenate([transform_points(part.pose, part.vertices)[part.faces] for part in model.parts])
    (y_foot, y_stands), (z_foot, z_stands) = _foot(corners, 1), _foot(corners, 2)
    y_moved, z_moved = _upside_down(corners)
    custom = CUSTOMS.get(model.path.suffix.lower())
    found = (
        STANDS * (float(y_stands) - float(z_stands)),
        FOOT_COUNTS * _log_ratio(y_foot, z_foot, FLOOR_FOOT),
        MIRROR_COUNTS * _log_ratio(y_moved, z_moved, FLOOR_MIRROR),
        0.0 if custom is None else CUSTOM if custom == "y" else -CUSTOM,
    )
    return dict(zip(REASONS, found, strict=True))


def _log_ratio(first: float, second: float, floor: float) -> float:
    return float(np.clip(np.log((first + floor) / (second + floor)), -MOST, MOST))


def _upside_down(corners: FloatArray) -> tuple[float, float]:
    """How far a surface is from its mirror image along y and along z, on average, as shares of the longest side."""
    triangles = corners.reshape(-1, 3)
    faces = np.arange(len(triangles), dtype=np.int32).reshape(-1, 3)
    points, _, _ = sample_surface(triangles, faces, LOOKED_AT, decision_rng(0, "choices", "up"))
    low, high = triangles.min(axis=0), triangles.max(axis=0)
    tree, moved = cKDTree(points), []
    for axis in _AXES.values():
        image = points.copy()
        image[:, axis] = low[axis] + high[axis] - image[:, axis]
        moved.append(float(tree.query(image)[0].mean() / (high - low).max()))
    return moved[0], moved[1]


def _foot(corners: FloatArray, axis: int) -> tuple[float, bool]:
    """Area of the hull of the lowest points along an axis, as a share of the box's largest side, and whether the middle
    of the surface of the triangles `corners` (t, 3, 3) is above it."""
    from scipy.spatial import ConvexHull, QhullError

    points = corners.reshape(-1, 3)
    height = points[:, axis]
    low = np.delete(points[height <= height.min() + FOOT * np.ptp(height)], axis, axis=1)
    areas = triangle_areas(corners)
    middle = np.delete(areas @ corners.mean(axis=1) / max(areas.sum(), 1e-300), axis)
    try:
        hull = ConvexHull(low)
    except (QhullError, ValueError):
        return 0.0, False
    above = (hull.equations[:, :2] @ middle + hull.equations[:, 2] < 0).all()
    return float(hull.volume / np.ptp(points, axis=0).max() ** 2), bool(above)


def _turns(identified: IdentifiedParts) -> list[int]:
    """How many parts are turned against the first of their type about x, y and z, by the least of such turns."""
    counts = np.zeros(3, dtype=np.int64)
    for assembly in identified.assemblies:
        for index, part_type in enumerate(identified.types):
            own = assembly.poses[assembly.types == index]
            for pose in own[1:]:
                images = pose @ part_type.symmetries
                images[:, :3, :3] = images[:, :3, :3] @ own[0, :3, :3].T
                angles = rotation_angle(images)
                if angles.min() >= TURNED:
                    counts += np.abs(_axis(images[angles.argmin(), :3, :3])) > ALONG
    found: list[int] = counts.tolist()
    return found


def _axis(rotation: FloatArray) -> FloatArray:
    """The axis of a rotation (3, 3): its eigenvector of eigenvalue 1."""
    values, vectors = np.linalg.eigh((rotation + rotation.T) / 2)
    axis: FloatArray = vectors[:, int(np.argmax(values))]
    return axis
