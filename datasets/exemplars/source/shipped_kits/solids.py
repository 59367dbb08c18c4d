"""Closed coloured polyhedra, and the operations that build kit parts: loft, extrude, revolve, inset, sweep.

Y is up. Faces are plane polygons, possibly with holes, counter-clockwise as seen from outside; a solid may consist of
several closed shells. Plan outlines (n, 2) are read as (x, -z): counter-clockwise as seen from above.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shipped_kits.outlines import grown, rectangle, regular, triangulate
from stages.shape.arrays import ByteArray, FloatArray, IntArray

Color = tuple[int, int, int]
"""sRGB, 0 to 255."""

Point = tuple[float, float, float]

COORDINATE_DECIMALS = 6
"""Far finer than any detail, far coarser than the last bits of a sine."""


@dataclass(frozen=True)
class Face:
    """A plane polygon: its outer loop, then its holes, as indices into the points of its solid."""

    loops: tuple[tuple[int, ...], ...]
    color: Color


@dataclass(frozen=True)
class Solid:
    """A polyhedron of one or more closed shells.

    points: float64 (n, 3)
    faces: plane polygons
    """

    points: FloatArray
    faces: tuple[Face, ...]

    def __add__(self, other: Solid) -> Solid:
        first = len(self.points)
        joined = tuple(
            Face(tuple(tuple(i + first for i in loop) for loop in face.loops), face.color) for face in other.faces
        )
        return Solid(np.concatenate([self.points, other.points]), self.faces + joined)

    def translated(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Return the solid moved by (x, y, z)."""
        return Solid(self.points + np.array([x, y, z]), self.faces)

    def rotated(self, degrees: float, axis: str = "y") -> Solid:
        """Return the solid rotated about a coordinate axis."""
        return Solid(self.points @ rotation(degrees, axis).T, self.faces)

    def tinted(self, color: Color, where: Callable[[int, FloatArray], bool]) -> Solid:
        """Recolour the faces for which `where(index, corners of the outer loop)` is true."""
        faces = tuple(
            replace(face, color=color) if where(index, self.points[list(face.loops[0])]) else face
            for index, face in enumerate(self.faces)
        )
        return Solid(self.points, faces)

    def around(self, count: int) -> Solid:
        """Return `count` copies of the solid, evenly rotated about the up axis."""
        copies = self
        for k in range(1, count):
            copies = copies + self.rotated(360.0 * k / count)
        return copies

    def inset(
        self,
        at: Point,
        outline: FloatArray,
        depth: float,
        color: Color,
        floor: Color | None = None,
        shrink: float = 0.0,
        copies: int = 1,
    ) -> Solid:
        """Push in the face at the point `at` by `depth` (pull it out if negative) within `outline`.

        `outline` is counter-clockwise, in the plane of the face: x to the right and y up as seen from outside, or
        (x, -z) on a face that looks up. The floor is `outline` shrunk by `shrink`, of colour `floor` or else
        `color`, which the sides have. With `copies` the same happens at as many places around the up axis.
        """
        result = self
        for k in range(copies):
            turn = rotation(360.0 * k / copies, "y")
            result = result._inset_once(turn @ np.array(at), turn, outline, depth, color, floor or color, shrink)
        return result

    def mesh(self) -> tuple[FloatArray, IntArray, ByteArray]:
        """Return vertices float64 (v, 3), faces int32 (f, 3) and face colours uint8 (f, 3)."""
        return self._mesh

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, ByteArray]:
        points = np.round(self.points, COORDINATE_DECIMALS) + 0.0
        triangles: list[tuple[int, int, int]] = []
        colors: list[Color] = []
        for face in self.faces:
            right, up, _ = _face_axes(points, face)
            plane = np.stack([points @ right, points @ up], axis=1)
            cut = triangulate(plane, face.loops)
            triangles += cut
            colors += [face.color] * len(cut)
        return points, np.array(triangles, dtype=np.int32), np.array(colors, dtype=np.uint8)

    def _inset_once(
        self,
        at: FloatArray,
        turn: FloatArray,
        outline: FloatArray,
        depth: float,
        color: Color,
        floor: Color,
        shrink: float,
    ) -> Solid:
        index = self._face_at(at)
        face = self.faces[index]
        right, up, normal = _face_axes(self.points, face)
        if abs(normal[1]) > 0.99:
            right, up = turn @ right, turn @ up
        rim = at + outline @ np.stack([right, up])
        end = at + grown(outline, -shrink) @ np.stack([right, up]) - depth * normal
        first, count = len(self.points), len(outline)
        top = tuple(range(first, first + count))
        bottom = tuple(range(first + count, first + 2 * count))
        following = [(k + 1) % count for k in range(count)]
        sides = tuple(Face(((top[k], top[n], bottom[n], bottom[k]),), color) for k, n in enumerate(following))
        opened = Face((*face.loops, top[::-1]), face.color)
        faces = (*self.faces[:index], opened, *self.faces[index + 1 :], *sides, Face((bottom,), floor))
        return Solid(np.concatenate([self.points, rim, end]), faces)

    def _face_at(self, at: FloatArray) -> int:
        """Return the newest face whose plane contains the point and whose outer loop goes around it."""
        for index in range(len(self.faces) - 1, -1, -1):
            face = self.faces[index]
            right, up, normal = _face_axes(self.points, face)
            loops = [self.points[list(loop)] for loop in face.loops]
            if abs(float((at - loops[0][0]) @ normal)) < 1e-6:
                flat = [np.stack([(loop - at) @ right, (loop - at) @ up], axis=1) for loop in loops]
                if _winds_around_origin(flat[0]) and not any(_winds_around_origin(hole) for hole in flat[1:]):
                    return index
        raise ValueError(f"no face at {at.tolist()}")


def joined(*solids: Solid) -> Solid:
    """Return all shells of the solids as one solid."""
    whole = solids[0]
    for solid in solids[1:]:
        whole = whole + solid
    return whole


def loft(rings: Sequence[FloatArray], colors: Color | Sequence[Color]) -> Solid:
    """Return the solid between rings (k, 3) of equally many corners, counter-clockwise as seen from the last one.

    A first or last ring of one point is a tip. `colors`: one for each band between two rings; the caps have the
    colours of the bands that they close.
    """
    bands = _bands(colors, len(rings) - 1)
    starts = np.cumsum([0, *(len(ring) for ring in rings)]).tolist()
    faces: list[Face] = []
    for band, color in enumerate(bands):
        low = list(range(starts[band], starts[band + 1]))
        high = list(range(starts[band + 1], starts[band + 2]))
        size = max(len(low), len(high))
        for k in range(size):
            n = (k + 1) % size
            loop = (low[k % len(low)], low[n % len(low)], high[n % len(high)], high[k % len(high)])
            faces.append(Face((tuple(dict.fromkeys(loop)),), color))
    if len(rings[0]) > 1:
        faces.append(Face((tuple(range(starts[1] - 1, -1, -1)),), bands[0]))
    if len(rings[-1]) > 1:
        faces.append(Face((tuple(range(starts[-2], starts[-1])),), bands[-1]))
    return Solid(np.concatenate([np.reshape(ring, (-1, 3)) for ring in rings]), tuple(faces))


def stacked(outline: FloatArray, levels: Sequence[tuple[float, float]], colors: Color | Sequence[Color]) -> Solid:
    """Stack a convex plan `outline`: each level has its growth and its height."""
    return loft([_at_height(grown(outline, growth), height) for growth, height in levels], colors)


def revolved(profile: Sequence[tuple[float, float]], sides: int, colors: Color | Sequence[Color]) -> Solid:
    """Return a column with regular sides, by apothem and height of each level; apothem 0 is a tip."""
    plans = [regular(sides, apothem) if apothem else np.zeros((1, 2)) for apothem, _ in profile]
    return loft([_at_height(plan, height) for plan, (_, height) in zip(plans, profile, strict=True)], colors)


def extruded(outline: FloatArray, z0: float, z1: float, color: Color) -> Solid:
    """Extrude an upright outline (n, 2) in (x, y), counter-clockwise as seen from +z, from z0 to z1."""
    rings = [np.column_stack([outline, np.full(len(outline), z)]) for z in (z0, z1)]
    return loft(rings, color)


def box(size: Point, at: Point, color: Color, bevel: float = 0.0) -> Solid:
    """Return a box with the centre of its bottom at `at`; `bevel` slants the edges of its top."""
    outline = rectangle(size[0], size[2])
    levels = [(0.0, 0.0), (0.0, size[1])]
    if bevel:
        levels = [(0.0, 0.0), (0.0, size[1] - bevel), (-bevel, size[1])]
    return stacked(outline, levels, color).translated(*at)


def bar(start: Point, end: Point, radius: float, color: Color, sides: int = 6) -> Solid:
    """Return a straight round bar between two points."""
    return swept([start, end], regular(sides, radius), color)


def swept(path: Sequence[Point], section: FloatArray, color: Color) -> Solid:
    """Sweep a section (k, 2), counter-clockwise, along a path without a vertical piece next to a slanted one.

    The section's x points to the left of the path, its y upward as far as the path lets it.
    """
    points = np.array(path, dtype=np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    upright = abs(steps[0, 1]) > 0.999
    rings = []
    for k, point in enumerate(points):
        before, after = steps[max(k - 1, 0)], steps[min(k, len(steps) - 1)]
        ahead = (before + after) / np.linalg.norm(before + after)
        left = np.cross([1.0, 0.0, 0.0] if upright else [0.0, 1.0, 0.0], ahead)
        left /= np.linalg.norm(left)
        up = np.cross(ahead, left)
        # A mitre is stretched across the bend; the section keeps its width in the plane of the path.
        stretch = 1.0 / max(float(ahead @ after), 0.5)
        bend = after - before
        sideways = left * (stretch if abs(float(bend @ left)) > abs(float(bend @ up)) else 1.0)
        upward = up * (stretch if abs(float(bend @ up)) >= abs(float(bend @ left)) else 1.0)
        rings.append(point + section[:, :1] * sideways + section[:, 1:] * upward)
    return loft(rings, color)


def rotation(degrees: float, axis: str) -> FloatArray:
    """Return the rotation (3, 3) about a coordinate axis, exact to 15 places at quarter turns."""
    angle = np.radians(degrees)
    c, s = np.round([np.cos(angle), np.sin(angle)], 12) + 0.0
    i = "xyz".index(axis)
    matrix = np.eye(3)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix[j, j], matrix[j, k], matrix[k, j], matrix[k, k] = c, -s, s, c
    return matrix


def _bands(colors: Color | Sequence[Color], count: int) -> list[Color]:
    bands = [color for color in colors if not isinstance(color, int)]
    if bands:
        if len(bands) != count:
            raise ValueError(f"{len(bands)} colours for {count} bands")
        return bands
    red, green, blue = (value for value in colors if isinstance(value, int))
    return [(red, green, blue)] * count


def _at_height(outline: FloatArray, height: float) -> FloatArray:
    return np.column_stack([outline[:, 0], np.full(len(outline), height), -outline[:, 1]])


def _face_axes(points: FloatArray, face: Face) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return right, up and outward normal of a face; on a face that faces up, right is x and up is -z."""
    corners = points[list(face.loops[0])]
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    normal /= np.linalg.norm(normal)
    up = np.array([0.0, 0.0, -np.sign(normal[1])]) if abs(normal[1]) > 0.99 else np.array([0.0, 1.0, 0.0])
    up = up - (up @ normal) * normal
    up /= np.linalg.norm(up)
    return np.cross(up, normal), up, normal


def _winds_around_origin(loop: FloatArray) -> bool:
    """Return whether a plane loop goes around the origin, by the crossings of a ray to the right."""
    inside = False
    for (x0, y0), (x1, y1) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
        if (y0 > 0.0) != (y1 > 0.0) and x0 - y0 * (x1 - x0) / (y1 - y0) > 0.0:
            inside = not inside
    return inside
