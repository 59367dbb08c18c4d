"""Which axis points up in some models: the files' own word, else where the models stand on the broader foot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from stages.exemplars.identify import Identified
from stages.exemplars.model import Model
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import rotation_angle, transform_points

__all__ = ["upward"]

FOOT = 0.01
"""What lies below this share of the height is the foot."""
SURE = 1.5
"""A foot so many times as large as the other says which axis is up."""
TURNED = 0.05
"""Radians from which on equal parts count as turned against each other."""
ALONG = 0.99
"""Cosine from which on an axis of rotation is one of the axes."""
MAJORITY = 0.75
"""So many of the rotations about y or z must agree."""

_AXES: dict[Literal["y", "z"], int] = {"y": 1, "z": 2}


def upward(models: Sequence[Model], identified: Identified) -> tuple[Literal["y", "z"], str]:
    """The axis that points up in `models`, whose parts are `identified`, and the reason, a sentence.

    A format that lets files choose is believed (COLLADA). glTF calls y up whatever stands in it, and other formats
    say nothing: there it is the axis along which alone the models would not fall over, their middle being above their
    foot, the hull of their lowest points; else the one along which they stand on the larger foot.
    Where feet are about alike it is the axis about which equal parts are turned; else y.
    """
    said = {model.up for model in models}
    if len(said) == 1 and None not in said:
        (word,) = said
        if word is not None:
            return word, "the file says so"
    stood = {axis: [_foot(model, place) for model in models] for axis, place in _AXES.items()}
    balanced = [axis for axis, each in stood.items() if all(stands for _, stands in each)]
    if len(balanced) == 1:
        return balanced[0], "along the other axis the middle of a model is not above its foot"
    feet = {axis: sum(area for area, _ in each) for axis, each in stood.items()}
    larger: Literal["y", "z"] = "y" if feet["y"] >= feet["z"] else "z"
    ratio = feet[larger] / max(feet["z" if larger == "y" else "y"], 1e-3 * feet[larger], 1e-300)
    if ratio >= SURE:
        return larger, f"the lowest points span {_times(ratio)} the area that they span along the other axis"
    turns = _turns(identified)
    for axis, place in _AXES.items():
        if turns[place] > MAJORITY * (turns[1] + turns[2]):
            return axis, f"equal parts are turned about {axis}, {turns[place]} of {turns[1] + turns[2]} times"
    return "y", "neither the foot nor the turns of equal parts tell, and y is the custom"


def _foot(model: Model, axis: int) -> tuple[float, bool]:
    """Area of the hull of the lowest points along an axis, as a share of the box's largest side, and whether the middle
    of the model's surface is above it."""
    from scipy.spatial import ConvexHull, QhullError

    corners = np.concatenate([transform_points(part.pose, part.vertices)[part.faces] for part in model.parts])
    points = corners.reshape(-1, 3)
    height = points[:, axis]
    low = np.delete(points[height <= height.min() + FOOT * np.ptp(height)], axis, axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = np.delete(areas @ corners.mean(axis=1) / max(areas.sum(), 1e-300), axis)
    try:
        hull = ConvexHull(low)
    except (QhullError, ValueError):
        return 0.0, False
    above = (hull.equations[:, :2] @ middle + hull.equations[:, 2] < 0).all()
    return float(hull.volume / np.ptp(points, axis=0).max() ** 2), bool(above)


def _turns(identified: Identified) -> list[int]:
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


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if ratio < 100 else "over 100 times"
