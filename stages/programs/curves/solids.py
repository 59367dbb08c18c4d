"""Solids without a rail: boxes, boards, cylinders, balls."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from stages.programs.curves.caps import Cap, fan
from stages.programs.curves.curve import Axis, axis_index
from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.profile import Profile
from stages.programs.curves.skin import skin
from stages.shape.arrays import FloatArray

BOX_QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32
)
"""Corners are numbered 4 x + 2 y + z."""

BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def box(size: npt.ArrayLike, center: npt.ArrayLike = (0.0, 0.0, 0.0)) -> QuadMesh:
    """A box with sides `size` (3,) around `center` (3,). Raises ValueError unless every side is above 0."""
    return QuadMesh(BOX_CORNERS * _sizes(size) + np.asarray(center, dtype=np.float64), BOX_QUADS)


def rounded_box(
    size: npt.ArrayLike, radius: float, center: npt.ArrayLike = (0.0, 0.0, 0.0), steps: int = 3
) -> QuadMesh:
    """A box whose edges are rounded by `radius` in `steps` steps: 1 step is a bevel, radius 0 a plain box.

    Raises ValueError for a side not above 0 and for a radius above half the shortest.
    """
    width, height, depth = _sizes(size).tolist()
    shortest = min(width, height, depth)
    if not 0.0 <= radius <= shortest / 2.0 * (1.0 + 1e-9):
        raise ValueError(f"a box's edge radius lies within 0 and half its shortest side, {shortest / 2:g}")
    if radius < 1e-9 * shortest:
        return box(size, center)
    # Slightly less than half, where opposite edges would meet; the first and last rings keep a small corner radius, or
    # their points would coincide.
    radius = min(radius, 0.499 * shortest)
    angles = np.linspace(0.0, np.pi / 2.0, steps + 1)
    radii = np.maximum(radius * np.sin(angles), 0.02 * radius)
    rise = radius * (1.0 - np.cos(angles))
    around = np.radians(np.arange(4)[:, None] * 90.0 + np.linspace(0.0, 90.0, steps + 1)).ravel()
    corner = np.repeat([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]], steps + 1, axis=0)
    # In the plane of z and x, counter-clockwise is as seen from +y.
    plan = corner * (np.array([depth, width]) / 2.0 - radius)
    rounded = plan + radii[:, None, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    rings = np.empty((2 * len(radii), len(plan), 3))
    rings[..., [2, 0]] = np.concatenate([rounded, rounded[::-1]])
    rings[..., 1] = np.concatenate([rise - height / 2.0, (height / 2.0 - rise)[::-1]])[:, None]
    return skin(rings + np.asarray(center, dtype=np.float64), Cap(fan(len(plan)), len(plan) > 4))


def extrude(
    profile: Profile, height: float, axis: Axis = "y", base: float = 0.0, bevel: float = 0.0, steps: int = 1
) -> QuadMesh:
    """A board: the profile in the plane across an axis (as `Profile.curve`), `height` thick from `base` on.

    bevel: radius of its upper and lower edges, in `steps` steps; 1 step cuts them at 45 degrees

    Raises ValueError for a height not above 0 and for a bevel too large for the profile or the height.
    """
    if not height > 0.0:
        raise ValueError(f"a board's height is above 0, not {height:g}")
    if not 0.0 <= bevel < height / 2.0:
        raise ValueError(f"a bevel lies within 0 and less than half the height, {height / 2:g}; not {bevel:g}")
    if bevel == 0.0:
        outlines, heights = [profile.points] * 2, np.array([0.0, height])
    else:
        angles = np.linspace(0.0, np.pi / 2.0, steps + 1)
        edge = [profile.inset(bevel * (1.0 - np.sin(angle))).points for angle in angles.tolist()]
        rise = bevel * (1.0 - np.cos(angles))
        outlines, heights = [*edge, *edge[::-1]], np.concatenate([rise, (height - rise)[::-1]])
    rings = np.empty((len(outlines), len(profile), 3))
    # The axes of the plane and the one across it are right-handed except for y, where rings go from the top down.
    first, second = {0: (1, 2), 1: (0, 2), 2: (0, 1)}[axis_index(axis)]
    rings[..., first], rings[..., second] = np.moveaxis(np.array(outlines), 2, 0)
    rings[..., axis_index(axis)] = base + (heights if axis != "y" else height - heights)[:, None]
    return skin(rings, profile.cap)


def cylinder(radius: float, height: float, top: float | None = None, count: int = 16) -> QuadMesh:
    """A cylinder on the plane y = 0, or a cone to the radius `top` (0: to a point).

    Raises ValueError unless radius and height are above 0.
    """
    top = radius if top is None else top
    if not (radius > 0.0 and height > 0.0 and top >= 0.0):
        raise ValueError(f"a cylinder's radius and height are above 0: {radius:g}, {height:g}, top {top:g}")
    around = _circle(count)
    rings = around * np.array([radius, top])[:, None, None]
    rings[1, :, 1] = height
    return skin(rings, Cap(fan(count), count > 4))


def ellipsoid(radii: npt.ArrayLike, center: npt.ArrayLike = (0.0, 0.0, 0.0), count: int = 16) -> QuadMesh:
    """A ball with radii (3,) around `center` (3,), `count` points around; radii above 0 or a ValueError."""
    mesh = _ball(count)
    return QuadMesh(mesh.vertices * _sizes(radii) + np.asarray(center, dtype=np.float64), mesh.quads)


@lru_cache(maxsize=32)
def _ball(count: int) -> QuadMesh:
    latitudes = np.linspace(-np.pi / 2.0, np.pi / 2.0, count // 2 + 1)
    widths = np.cos(latitudes)
    widths[[0, -1]] = 0.0
    rings = _circle(count) * widths[:, None, None]
    rings[..., 1] = np.sin(latitudes)[:, None]
    return skin(rings, Cap(fan(count), count > 4))


@lru_cache(maxsize=32)
def _circle(count: int) -> FloatArray:
    """Points around the y axis, counter-clockwise seen from +y, float64 (count, 3)."""
    if count < 3:
        raise ValueError(f"a circle needs 3 points or more, not {count}")
    angles = 2.0 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angles), np.zeros(count), -np.sin(angles)], axis=1)
    around.flags.writeable = False
    return around


def _sizes(size: npt.ArrayLike) -> FloatArray:
    sizes = np.asarray(size, dtype=np.float64)
    if sizes.shape != (3,) or not sizes.min() > 0.0:
        raise ValueError(f"three sizes above 0 are needed, not {sizes.tolist()}")
    return sizes
