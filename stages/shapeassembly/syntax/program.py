"""The tree of a ShapeAssembly program (shapeassembly §4, table 1): assemblies of cuboids and the lines that join them.

Points are in local coordinates of a cuboid: 0 to 1 along its x, y and z axes; (0.5, 0.0, 0.5) is the centre of its
bottom. Lengths have no unit. y points up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

Axis = Literal["X", "Y", "Z"]
Face = Literal["right", "left", "top", "bot", "front", "back"]
Point = tuple[float, float, float]

AXES: tuple[Axis, ...] = get_args(Axis)
FACES: tuple[Face, ...] = get_args(Face)
"""In the order of table 1: for each axis the face at 1, then the face at 0."""

BBOX = "bbox"
"""Name of the bounding box of every assembly."""


@dataclass(frozen=True, slots=True)
class Cuboid:
    """`name = Cuboid(l, h, w, aligned)`: a part, its sizes along x, y and z, and whether it never turns."""

    name: str
    dims: Point
    aligned: bool


@dataclass(frozen=True, slots=True)
class Attach:
    """`attach(moved, target, x1, y1, z1, x2, y2, z2)`: move point `source` of one onto point `goal` of the other."""

    moved: str
    target: str
    source: Point
    goal: Point


@dataclass(frozen=True, slots=True)
class Squeeze:
    """`squeeze(moved, first, second, face, u, v)`: place a cuboid between two others, `face` towards the first."""

    moved: str
    first: str
    second: str
    face: Face
    u: float
    v: float


@dataclass(frozen=True, slots=True)
class Reflect:
    """`reflect(moved, axis)`: add a copy mirrored about the middle of the bounding box."""

    moved: str
    axis: Axis


@dataclass(frozen=True, slots=True)
class Translate:
    """`translate(moved, axis, copies, distance)`: add shifted copies, the last by `distance` times the bounding box."""

    moved: str
    axis: Axis
    copies: int
    distance: float


Line = Cuboid | Attach | Squeeze | Reflect | Translate


@dataclass(frozen=True)
class Block:
    """`Assembly name { ... }`: its bounding box, and its other lines in order."""

    name: str
    bbox: Cuboid
    lines: tuple[Line, ...]

    @property
    def cuboids(self) -> tuple[Cuboid, ...]:
        """The declared cuboids, without the bounding box and without copies."""
        return tuple(line for line in self.lines if isinstance(line, Cuboid))


@dataclass(frozen=True)
class AssemblyProgram:
    """Assemblies, the root first. A cuboid with the name of an assembly is expanded by it."""

    blocks: tuple[Block, ...]

    @property
    def root(self) -> Block:
        return self.blocks[0]

    @cached_property
    def named(self) -> dict[str, Block]:
        """The assemblies by name."""
        return {block.name: block for block in self.blocks}

    def with_lines(self, change: Callable[[Line], Line]) -> AssemblyProgram:
        """Apply `change` to every line, bounding boxes included."""
        return AssemblyProgram(tuple(_changed(block, change) for block in self.blocks))


def _changed(block: Block, change: Callable[[Line], Line]) -> Block:
    bbox = change(block.bbox)
    assert isinstance(bbox, Cuboid)
    return replace(block, bbox=bbox, lines=tuple(change(line) for line in block.lines))
