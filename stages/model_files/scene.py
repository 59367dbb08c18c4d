"""The result of every reader: surfaces and their placements, with face colours and materials."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.shape.appearance import Appearance
from stages.shape.arrays import ByteArray, FloatArray, IntArray

INVALID = "is missing or invalid"
"""The fault of an element in a message, if the reader does not know more."""


class Malformed(ValueError):
    """A file is malformed; the message says what is wrong and where."""


GREY = (160, 160, 160)
"""sRGB of faces without a colour."""

_MAX_NAME_LENGTH = 200


@dataclass(frozen=True)
class Surface:
    """A triangle mesh of the file.

    vertices: float64 (v, 3).
    faces: int32 (f, 3).
    face_colors: uint8 (f, 3) sRGB.
    face_material: int32 (f,), index into `materials`, -1 for a face without material.
    paint: uint8 (f, 3) sRGB, the face or vertex colours of the file, without materials; None if it has none.
    appearance: materials with textures, texture coordinates and normals; None if the file has none.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray
    materials: tuple[str, ...] = ()
    face_material: IntArray | None = None
    paint: ByteArray | None = None
    appearance: Appearance | None = None

    def select(self, faces: np.ndarray) -> Surface:
        """Return the surface of the faces with indices `faces`, without unused vertices."""
        used, renumbered = np.unique(self.faces[faces], return_inverse=True)
        return Surface(
            name=self.name,
            vertices=self.vertices[used],
            faces=renumbered.reshape(-1, 3).astype(np.int32),
            face_colors=self.face_colors[faces],
            materials=self.materials,
            face_material=None if self.face_material is None else self.face_material[faces],
            paint=None if self.paint is None else self.paint[faces],
            appearance=None if self.appearance is None else self.appearance.select(faces),
        )


@dataclass(frozen=True)
class Placement:
    """A named surface in the world.

    label: the file's label for the type of the part, if it has one.
    surface: index into the surfaces of the scene.
    pose: float64 (4, 4), any affine map with an inverse.
    node: index into the nodes of the scene, for a format with a node tree.
    """

    name: str
    label: str | None
    surface: int
    pose: FloatArray
    node: int | None = None


@dataclass(frozen=True)
class SceneNode:
    """A node of the node tree.

    parent: index of the node that it hangs below, -1 for a root.
    """

    name: str
    parent: int


@dataclass(frozen=True)
class ModelScene:
    """The surfaces of a file and their placements, in the order of the file.

    kind: whether placements are nodes of a scene graph or named objects of one mesh.
    warnings: what was left out, replaced or guessed, a sentence each.
    up: the axis that points up as the file states it, if its format lets files choose.
    unit: metres of one unit of the coordinates, if the format or the file says; DAE files are converted to metres.
    nodes: the node tree, parents before their children; empty for formats without one.
    not_kept: what materials of the file have that no appearance holds, a sentence each.
    writer: the program that wrote the file, as the file states it, else empty.
    """

    kind: Literal["nodes", "objects"]
    surfaces: tuple[Surface, ...]
    placements: tuple[Placement, ...]
    warnings: tuple[str, ...] = ()
    up: Literal["y", "z"] | None = None
    unit: float | None = None
    nodes: tuple[SceneNode, ...] = ()
    not_kept: tuple[str, ...] = ()
    writer: str = ""


def type_label(name: str) -> str:
    """Return the type in the name of a part: `wall` of `wall.003` and of `wall_12`, else the name itself."""
    return re.sub(r"(?<=.)[._]\d+$", "", name)


class UniqueNames:
    """Give every name once."""

    def __init__(self) -> None:
        self._copies: dict[str, int] = {}

    def __call__(self, name: str) -> str:
        """Return `name`, or `name#2`, `name#3`, ... if it is taken."""
        unique = name
        while unique in self._copies:
            self._copies[name] += 1
            unique = f"{name}#{self._copies[name]}"
        self._copies[unique] = 1
        return unique


def plain_text(text: str) -> str:
    """Return `text` with unprintable characters and lone surrogates replaced."""
    return text if text.isprintable() else "".join(char if char.isprintable() else "\ufffd" for char in text)


def plain_name(name: str) -> str:
    """Return `plain_text` of a name, cut if it is too long."""
    return plain_text(name) if len(name) <= _MAX_NAME_LENGTH else plain_text(name[:_MAX_NAME_LENGTH]) + "…"
