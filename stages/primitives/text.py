"""The text of a composition: its solids as JSON, and the shape that they make."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import get_args

import numpy as np

from stages.primitives.settings import KINDS, Kind
from stages.primitives.solids import solid_mesh
from stages.programs.curves import QuadMesh
from stages.programs.curves.transforms import mirroring
from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shape.views.palette import label_colors

NUMBER_DIGITS = 6


class CompositionError(ValueError):
    """A text that describes no composition of solids."""


@dataclass(frozen=True)
class PlacedSolid:
    """A solid in a shape, its numbers rounded as in the text.

    numbers: of its kind
    mirrored: whether its mesh is mirrored in the plane x = 0
    turn: unit quaternion w, x, y, z
    place: position of the middle of its box
    """

    kind: Kind
    numbers: tuple[float, ...]
    mirrored: bool
    turn: tuple[float, ...]
    place: tuple[float, ...]

    @property
    def mesh(self) -> QuadMesh:
        """The mesh before it is placed. Raises ValueError for numbers that make no solid."""
        mesh = solid_mesh(self.kind, self.numbers)
        return mesh.transformed(mirroring("x")) if self.mirrored else mesh

    @property
    def pose(self) -> FloatArray:
        """The rigid transform, float64 (4, 4)."""
        pose = np.eye(4)
        pose[:3, :3] = rotation_of(self.turn)
        pose[:3, 3] = self.place
        return pose

    @property
    def vertices(self) -> FloatArray:
        """The placed vertices, float64 (v, 3)."""
        pose = self.pose
        placed: FloatArray = self.mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
        return placed


def placed_solid(kind: Kind, numbers: Iterable[float], mirrored: bool, pose: FloatArray) -> PlacedSolid:
    """Return a solid at a rigid pose (4, 4), its numbers rounded."""
    return PlacedSolid(
        kind, _rounded(numbers), mirrored, _rounded(_quaternion(pose[:3, :3])), _rounded(pose[:3, 3].tolist())
    )


def _rounded(numbers: Iterable[float]) -> tuple[float, ...]:
    return tuple(round(float(number), NUMBER_DIGITS) + 0.0 for number in numbers)


def rotation_of(turn: Iterable[float]) -> FloatArray:
    """Return the rotation matrix (3, 3) of a quaternion w, x, y, z."""
    w, x, y, z = np.array(tuple(turn)) / np.linalg.norm(tuple(turn))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quaternion(rotation: FloatArray) -> list[float]:
    """Return the quaternion of a rotation (3, 3), by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    rows = [
        [1 + a + e + i, h - f, c - g, d - b],
        [h - f, 1 + a - e - i, b + d, c + g],
        [c - g, b + d, 1 - a + e - i, f + h],
        [d - b, c + g, f + h, 1 - a - e + i],
    ]
    best = max(range(4), key=lambda row: rows[row][row])
    quaternion = np.array(rows[best]) / np.linalg.norm(rows[best])
    return [float(number) for number in quaternion]


def composition_text(solids: Iterable[PlacedSolid]) -> str:
    """Return the text of a composition."""
    rows = [
        {"kind": s.kind, "numbers": s.numbers, "mirrored": s.mirrored, "turn": s.turn, "place": s.place} for s in solids
    ]
    return json.dumps({"solids": rows}, separators=(",", ":"), allow_nan=False)


def read_composition(text: str) -> list[PlacedSolid]:
    """Return the solids of a text. Raises CompositionError for one that describes none."""
    try:
        rows = json.loads(text)["solids"]
        solids = [
            PlacedSolid(row["kind"], tuple(row["numbers"]), row["mirrored"], tuple(row["turn"]), tuple(row["place"]))
            for row in rows
        ]
        for solid in solids:
            if solid.kind not in get_args(Kind) or not np.isfinite([*solid.numbers, *solid.turn, *solid.place]).all():
                raise ValueError(f"{solid.kind} is no solid")
    except (ValueError, KeyError, TypeError) as error:
        raise CompositionError(f"the text is no composition of solids: {error!r}") from error
    if not solids:
        raise CompositionError("the text lists no solids")
    return solids


def shape_of_solids(solids: Iterable[PlacedSolid]) -> Shape:
    """Return the shape of solids: equal ones share a mesh. Raises ValueError for numbers that make no solid."""
    listed = list(solids)
    colors = label_colors(len(KINDS))
    meshes: dict[tuple[str, tuple[float, ...], bool], PartMesh] = {}
    for solid in listed:
        key = (solid.kind, solid.numbers, solid.mirrored)
        if key not in meshes:
            faces = solid.mesh.triangles
            color = np.tile(colors[KINDS.index(solid.kind)], (len(faces), 1))
            meshes[key] = PartMesh(solid.kind, solid.mesh.vertices, faces, color)
    kinds = {key: number for number, key in enumerate(meshes)}
    types = np.array([kinds[solid.kind, solid.numbers, solid.mirrored] for solid in listed], dtype=np.int16)
    poses = np.stack([solid.pose for solid in listed])
    return Shape(tuple(meshes.values()), Assembly(types, poses, np.empty((0, 2), np.int32)), "y", KINDS)


def shape_of_composition_text(text: str) -> Shape:
    """Return the shape of a text. Raises CompositionError for one that describes none."""
    try:
        return shape_of_solids(read_composition(text))
    except CompositionError:
        raise
    except (ValueError, TypeError) as error:
        raise CompositionError(f"the text has numbers that make no solid: {error}") from error
