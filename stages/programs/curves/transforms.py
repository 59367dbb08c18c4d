"""Transforms of elements: attachment, stretching, turning, mirroring (geocode §3.1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.programs.curves.curve import Axis, axis_index
from stages.shape.arrays import FloatArray


def translation(x: float, y: float, z: float) -> FloatArray:
    """Move by (x, y, z)."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def rotation(axis: Axis, degrees: float, center: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Turn about an axis through `center` (3,), counter-clockwise seen from the axis' tip."""
    index = axis_index(axis)
    first, second = (index + 1) % 3, (index + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(4)
    matrix[first, first], matrix[second, second], matrix[first, second], matrix[second, first] = (
        cosine,
        cosine,
        -sine,
        sine,
    )
    return _about(matrix, center)


def scaling(x: float, y: float, z: float, center: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Scale along the axes about `center` (3,)."""
    return _about(np.diag([x, y, z, 1.0]), center)


def mirroring(axis: Axis, at: float = 0.0) -> FloatArray:
    """Mirror in the plane where the coordinate `axis` is `at`."""
    matrix = np.eye(4)
    matrix[axis_index(axis), axis_index(axis)], matrix[axis_index(axis), 3] = -1.0, 2.0 * at
    return matrix


def frame(origin: npt.ArrayLike, z: npt.ArrayLike, y: npt.ArrayLike) -> FloatArray:
    """A frame (4, 4) at `origin` (3,) whose third axis is parallel to `z` and whose second leans towards `y`.

    As in `Curve.frames`, the third axis is the tangent. Raises ValueError where `y` is parallel to `z`.
    """
    third, lean = np.asarray(z, dtype=np.float64), np.asarray(y, dtype=np.float64)
    first = np.cross(lean, third)
    size = float(np.linalg.norm(first))
    if not size > 1e-9 * float(np.linalg.norm(third)) * float(np.linalg.norm(lean)):
        raise ValueError(f"no frame has its z along {third.tolist()} and its y towards {lean.tolist()}")
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 2] = first / size, third / np.linalg.norm(third)
    matrix[:3, 1] = np.cross(matrix[:3, 2], matrix[:3, 0])
    matrix[:3, 3] = origin
    return matrix


def attach(own: FloatArray, to: FloatArray) -> FloatArray:
    """The matrix that moves an element with its frame `own` onto the frame `to`, both rigid (4, 4).

    `Curve.frames` gives frames at relative positions, and `frame` any other.
    """
    inverse = np.eye(4)
    inverse[:3, :3] = own[:3, :3].T
    inverse[:3, 3] = -own[:3, :3].T @ own[:3, 3]
    return to @ inverse


def stretch(
    own: tuple[npt.ArrayLike, npt.ArrayLike],
    to: tuple[npt.ArrayLike, npt.ArrayLike],
    up: npt.ArrayLike = (0.0, 1.0, 0.0),
    own_up: npt.ArrayLike = (0.0, 1.0, 0.0),
    uniform: bool = False,
) -> FloatArray:
    """The matrix that stretches an element between two attachments, from `own` = (start, end) onto `to` = (start, end).

    The element keeps its cross-section, or scales with its length where `uniform`. Its direction `own_up` is turned
    towards `up`. To keep the thickness of a handle, stretch a unit curve, then sweep it. Raises ValueError where two
    points coincide, and where an up direction is parallel to its line.
    """
    start, end = (np.asarray(point, dtype=np.float64) for point in own)
    goal, goal_end = (np.asarray(point, dtype=np.float64) for point in to)
    length, goal_length = float(np.linalg.norm(end - start)), float(np.linalg.norm(goal_end - goal))
    if not length > 0.0 or not goal_length > 0.0:
        raise ValueError("an element is stretched between two different points: move the attachments apart")
    share = goal_length / length
    from_frame, to_frame = frame(start, end - start, own_up), frame(goal, goal_end - goal, up)
    sizes = np.diag([share, share, share, 1.0] if uniform else [1.0, 1.0, share, 1.0])
    inverse = attach(from_frame, np.eye(4))
    stretched: FloatArray = to_frame @ sizes @ inverse
    return stretched


def _about(matrix: FloatArray, center: npt.ArrayLike) -> FloatArray:
    middle = np.asarray(center, dtype=np.float64)
    matrix[:3, 3] = middle - matrix[:3, :3] @ middle
    return matrix
