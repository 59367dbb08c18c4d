"""Solids by kind and numbers: random numbers of a kind, and the mesh that they make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from stages.primitives.settings import Kind
from stages.programs.curves import (
    Profile,
    QuadMesh,
    Style,
    bezier,
    box,
    cylinder,
    ellipsoid,
    extrude,
    hollow,
    polyline,
    revolve,
    square_circle,
    sweep,
)

Draw = Callable[[], float]
"""Draws a length."""

PROFILE_COUNT = 5
"""Profiles of extrusions: L, U, T, cross and star."""
VESSEL_WALL_SHARE = 0.2
ROUND: frozenset[Kind] = frozenset({"cylinder", "cone", "torus", "revolution"})
"""Kinds that any turn about their axis leaves almost as they are."""


def draw_numbers(kind: Kind, length: Draw, rng: np.random.Generator) -> tuple[float, ...]:
    """Return random numbers of a solid of a kind, as `solid_mesh` takes them."""
    if kind in ("box", "sphere"):
        return (length(), length(), length())
    if kind == "cylinder":
        return (length() / 2, length())
    if kind == "cone":
        return (length() / 2, length(), float(rng.choice([0.0, rng.uniform(0.2, 0.8)])))
    if kind == "torus":
        return (length() / 2, float(rng.uniform(0.15, 0.45)))
    if kind == "tube":
        return (length() / 2, length(), float(rng.uniform(0.5, 0.85)), float(rng.choice([4, 24])))
    if kind == "extrusion":
        return (float(rng.integers(PROFILE_COUNT)), length(), length(), length(), float(rng.uniform(0.25, 0.6)))
    if kind == "sweep":
        bend = rng.normal(0, 0.5, 4)
        return (length() + length(), float(rng.uniform(0.06, 0.15)), float(rng.uniform(0.5, 1.0)), *bend.tolist())
    return (length() / 2, length(), *rng.uniform(0.35, 1.0, 4).tolist(), float(rng.integers(2)))


@lru_cache(maxsize=4096)
def solid_mesh(kind: Kind, numbers: tuple[float, ...]) -> QuadMesh:
    """Return the mesh of a solid, with its axis along y and the middle of its box at the origin.

    Raises ValueError for numbers that make no solid.
    """
    mesh = _MAKERS[kind](*numbers)
    low, high = mesh.bounds
    return QuadMesh(mesh.vertices - (low + high) / 2, mesh.quads)


def _box(width: float, height: float, depth: float) -> QuadMesh:
    return box((width, height, depth))


def _sphere(width: float, height: float, depth: float) -> QuadMesh:
    return ellipsoid((width / 2, height / 2, depth / 2), count=24)


def _cylinder(radius: float, height: float) -> QuadMesh:
    return cylinder(radius, height, count=24)


def _cone(radius: float, height: float, top: float) -> QuadMesh:
    return cylinder(radius, height, top=top * radius, count=24)


def _torus(radius: float, tube: float) -> QuadMesh:
    around = np.linspace(0, 2 * np.pi, 13)[:-1]
    ring = radius + tube * radius * np.cos(around), tube * radius * np.sin(around)
    return revolve(polyline(np.column_stack([*ring, np.zeros(12)]), closed=True), count=24)


def _tube(radius: float, height: float, inner: float, count: float) -> QuadMesh:
    corners = [(inner * radius, 0), (radius, 0), (radius, height), (inner * radius, height)]
    return revolve(polyline([(x, y, 0) for x, y in corners], closed=True), count=int(count))


def _extrusion(profile: float, width: float, depth: float, height: float, thickness: float) -> QuadMesh:
    outline = _profile(int(profile), thickness) * [width, depth]
    return extrude(Profile.of(outline), height)


def _profile(number: int, thickness: float) -> np.ndarray:
    """Return a profile in the unit square: a square without some rectangles, or a star."""
    t, s = thickness, thickness / 2
    corners: Sequence[tuple[float, float]]
    if number == 0:
        corners = [(0, 0), (1, 0), (1, t), (t, t), (t, 1), (0, 1)]
    elif number == 1:
        corners = [(0, 0), (1, 0), (1, 1), (1 - s, 1), (1 - s, t), (s, t), (s, 1), (0, 1)]
    elif number == 2:
        corners = [
            (0.5 - s, 0),
            (0.5 + s, 0),
            (0.5 + s, 1 - t),
            (1, 1 - t),
            (1, 1),
            (0, 1),
            (0, 1 - t),
            (0.5 - s, 1 - t),
        ]
    elif number == 3:
        low, high = 0.5 - s, 0.5 + s
        arms = [(low, 0), (high, 0), (high, low), (1, low), (1, high), (high, high)]
        corners = [*arms, (high, 1), (low, 1), (low, high), (0, high), (0, low), (low, low)]
    else:
        angles = np.linspace(0, 2 * np.pi, 11)[:-1]
        reach = np.where(np.arange(10) % 2, 0.5 * t, 0.5)
        corners = [(0.5 + r * np.sin(a), 0.5 - r * np.cos(a)) for r, a in zip(reach, angles, strict=True)]
    return np.array(corners)


def _sweep(length: float, width: float, end: float, *bend: float) -> QuadMesh:
    first, second, third, fourth = np.clip(bend, -1, 1) * length / 2
    controls = [(0, 0, 0), (first, length / 3, second), (third, 2 * length / 3, fourth), (third, length, fourth)]
    profile = square_circle(1.0, width * length, width * length, count=12)
    return sweep(bezier(controls, 12), profile, Style.taper(1.0, end), up=(0, 0, 1))


def _revolution(
    radius: float, height: float, foot: float, low: float, high: float, rim: float, open_: float
) -> QuadMesh:
    controls = [
        (foot * radius, 0, 0),
        (low * radius, height / 3, 0),
        (high * radius, 2 * height / 3, 0),
        (rim * radius, height, 0),
    ]
    outline = bezier(controls, 10)
    if open_:
        outline = hollow(outline, VESSEL_WALL_SHARE * min(foot, rim, low, high) * min(radius, height))
    return revolve(outline, count=24)


_MAKERS: dict[Kind, Callable[..., QuadMesh]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "cone": _cone,
    "torus": _torus,
    "tube": _tube,
    "extrusion": _extrusion,
    "sweep": _sweep,
    "revolution": _revolution,
}
