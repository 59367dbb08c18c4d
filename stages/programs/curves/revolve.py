"""Revolve: an outline turned around the y axis; and the outline of a vessel with a wall."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stages.programs.curves.caps import Cap, fan, polygon_cap
from stages.programs.curves.curve import Curve
from stages.programs.curves.mesh import QuadMesh, reversed_faces
from stages.programs.curves.skin import skin
from stages.shape.arrays import FloatArray


def revolve(outline: Curve, angle: float = 360.0, count: int = 24) -> QuadMesh:
    """Revolve an outline in the plane z = 0 (x the radius, y the height) around the y axis.

    An open outline goes from the foot to the top of a solid body, in either direction. The body is closed flat where
    the outline ends off the axis. Points on the axis are poles. A closed outline makes a ring, such as a torus.

    angle: in degrees, from +x towards -z; less than 360 gives a piece with flat sides
    count: number of steps

    Raises ValueError for a negative radius, for an outline that touches the axis in between, and for other angles.
    """
    points = outline.points[:, :2]
    size = float(np.abs(points).max())
    if np.abs(outline.points[:, 2]).max() > 1e-9 * size:
        raise ValueError("an outline lies in the plane z = 0: x is the radius, y the height")
    if points[:, 0].min() < -1e-9 * size:
        raise ValueError(f"an outline's radius (x) is not negative, this one's is {points[:, 0].min():g}")
    if not 0.0 < angle <= 360.0 or count < 3:
        raise ValueError(f"an angle lies above 0 and up to 360, in 3 steps or more; not {angle:g} in {count}")
    radii = np.where(points[:, 0] <= 1e-9 * size, 0.0, points[:, 0])
    section = np.column_stack([radii, points[:, 1]])
    if (radii if outline.closed else radii[1:-1]).min(initial=1.0) == 0.0:
        raise ValueError("an outline touches the axis at its ends alone: split it there")
    if not outline.closed:
        section = _closed_by_axis(section)
    x, y = section.T
    if x @ np.roll(y, -1) - y @ np.roll(x, -1) < 0.0:
        section = section[::-1]
    whole = angle >= 360.0 - 1e-9
    if outline.closed:
        return _ring(section, angle, count, whole)
    return _whole(section, count) if whole else _piece(section, angle, count)


def _closed_by_axis(section: FloatArray) -> FloatArray:
    """The outline with its ends extended to the axis."""
    ends: list[FloatArray] = []
    if section[0, 0] > 0.0:
        ends.append(np.array([[0.0, section[0, 1]]]))
    ends.append(section)
    if section[-1, 0] > 0.0:
        ends.append(np.array([[0.0, section[-1, 1]]]))
    closed = np.concatenate(ends)
    if abs(closed[0, 1] - closed[-1, 1]) <= 1e-9 * np.abs(closed).max():
        raise ValueError("an outline that ends at the height at which it starts encloses nothing: raise an end")
    return closed


def _around(angle: float, count: int, whole: bool) -> FloatArray:
    """Directions around the axis, clockwise seen from +y down to angle 0, float64 (count or count + 1, 3)."""
    angles = np.radians(np.linspace(angle, 0.0, count + 1))[int(whole) :]
    return np.stack([np.cos(angles), np.zeros(len(angles)), -np.sin(angles)], axis=1)


def _ring(section: FloatArray, angle: float, count: int, whole: bool) -> QuadMesh:
    """The revolved closed outline."""
    rings = section[None, :, :1] * _around(angle, count, whole)[:, None]
    rings[..., 1] = section[:, 1]
    return skin(rings, polygon_cap(section), whole)


def _whole(section: FloatArray, count: int) -> QuadMesh:
    """A body around the whole axis: rings of `count` points one above the other, between two poles."""
    rings = section[:, None, :1] * _around(360.0, count, True)[::-1]
    rings[..., 1] = section[:, 1:]
    return skin(rings, Cap(fan(count), count > 4))


def _piece(section: FloatArray, angle: float, count: int) -> QuadMesh:
    """A piece of a body, whose two sides meet at the axis."""
    around = _around(angle, count, False)
    inner = section[1:-1]
    grid = inner[None, :, :1] * around[:, None]
    grid[..., 1] = inner[:, 1]
    poles = np.array([[0.0, section[0, 1], 0.0], [0.0, section[-1, 1], 0.0]])
    cap = polygon_cap(section)
    vertices = [poles, grid.reshape(-1, 3)]
    if cap.middle:
        middle = section.mean(axis=0)
        vertices.append(middle[0] * around[[0, -1]] + np.array([0.0, middle[1], 0.0]))
    inside, total = len(inner), 2 + grid.shape[0] * grid.shape[1]
    sides = []
    for last in (False, True):
        base = 2 + (grid.shape[0] - 1) * inside if last else 2
        # The section's points, pole to pole, then its middle.
        index = np.concatenate([[0], base + np.arange(inside), [1], [total + last]])
        quads = index[cap.quads]
        sides.append(quads if last else reversed_faces(quads))
    return QuadMesh(
        np.concatenate(vertices), np.concatenate([_piece_faces(grid.shape[0], inside), *sides]).astype(np.int32)
    )


@lru_cache(maxsize=256)
def _piece_faces(columns: int, inside: int) -> np.ndarray:
    """The faces between the columns, from the lower pole 0 to the upper pole 1, int (q, 4)."""
    column = 2 + np.arange(columns - 1)[:, None] * inside
    index = np.arange(inside - 1)
    here, there = column + index, column + inside + index
    quads = np.stack([here, here + 1, there + 1, there], axis=-1).reshape(-1, 4)
    low, low_next = column.ravel(), column.ravel() + inside
    zeros = np.zeros(len(low), dtype=np.int64)
    lower = np.stack([low, low_next, zeros, zeros], axis=1)
    upper = np.stack([low_next + inside - 1, low + inside - 1, zeros + 1, zeros + 1], axis=1)
    return np.concatenate([quads, lower, upper])


def hollow(outline: Curve, thickness: float) -> Curve:
    """The outline of an open vessel with a wall: up the outer side, over the rim, down the inner side; for `revolve`.

    outline: the outer side, open, in the plane z = 0, rising from the foot to the rim
    thickness: of wall and floor

    Raises ValueError where no space is left within, or where the outline does not rise.
    """
    if thickness <= 0.0 or outline.closed or outline.points[-1, 1] <= outline.points[0, 1]:
        raise ValueError("a vessel needs a wall thicker than 0 and an open outline that rises from the foot to the rim")
    outer = outline.points
    tangents = outline.own_stations.tangents
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    inner = outer[:, :2] + thickness * normals
    # The rim is horizontal, and the floor is as thick as the wall.
    rim, floor = outer[-1, 1], outer[0, 1] + thickness
    if inner[-1, 0] <= 0.0 or floor >= rim:
        raise ValueError(f"a wall of {thickness:g} leaves no space within the vessel: make it thinner")
    inner[-1] = [inner[-1, 0], rim]
    kept, lowest = [inner[-1]], rim
    for radius, height in inner[-2::-1].tolist():
        # Offset outlines intersect themselves at tight bends, and cross the axis in narrow feet.
        if radius > 1e-6 and floor < height < lowest:
            kept.append(np.array([radius, height]))
            lowest = height
    floor_radius = float(np.interp(floor, [p[1] for p in kept[::-1]], [p[0] for p in kept[::-1]]))
    kept.extend([np.array([floor_radius, floor]), np.array([0.0, floor])])
    path = np.concatenate([outer[:, :2], np.array(kept)])
    return Curve.through(path)
