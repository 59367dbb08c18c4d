"""What every reader makes of a file: surfaces, placed in the world, with what the file says about their faces."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray, IntArray

SENSELESS = "is not there, or says what cannot be"
"""What becomes of an element in a message, where only Python knows more."""


class Malformed(ValueError):
    """What a file says makes no sense; the message says what and where, in our words."""


GREY = (160, 160, 160)
"""sRGB of a face of which the file says nothing."""

_LONGEST = 200
"""Characters that the name of a part has at most."""


@dataclass(frozen=True)
class Surface:
    """A triangle mesh of the file.

    vertices: float64 (v, 3); faces: int32 (f, 3); face_colors: uint8 (f, 3) sRGB.
    face_material: int32 (f,), index into `materials`, -1 where a face has none.
    paint: uint8 (f, 3) sRGB, the face or vertex colours of the file itself, apart from its materials; None where
    it has none.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray
    materials: tuple[str, ...] = ()
    face_material: IntArray | None = None
    paint: ByteArray | None = None

    def select(self, faces: np.ndarray) -> Surface:
        """The surface of the faces with indices `faces`, with the vertices that these use, in their order."""
        used, renumbered = np.unique(self.faces[faces], return_inverse=True)
        return Surface(
            name=self.name,
            vertices=self.vertices[used],
            faces=renumbered.reshape(-1, 3).astype(np.int32),
            face_colors=self.face_colors[faces],
            materials=self.materials,
            face_material=None if self.face_material is None else self.face_material[faces],
            paint=None if self.paint is None else self.paint[faces],
        )


@dataclass(frozen=True)
class Placement:
    """A surface in the world under a name of its own.

    label: the file's own word for the type of the part, if it has one.
    pose: float64 (4, 4), any affine map with an inverse.
    """

    name: str
    label: str | None
    surface: int
    pose: FloatArray


@dataclass(frozen=True)
class ModelScene:
    """The surfaces of a file and their placements, in the order of the file.

    kind: whether placements are nodes of a scene graph or named objects of one mesh.
    up: the axis that points up by the file's own word, where the format lets files choose.
    """

    kind: Literal["nodes", "objects"]
    surfaces: tuple[Surface, ...]
    placements: tuple[Placement, ...]
    warnings: tuple[str, ...] = ()
    up: Literal["y", "z"] | None = None


def type_label(name: str) -> str:
    """The word for the type in the name of a part: `wall` of `wall.003` and of `wall_12`, else the name itself."""
    return re.sub(r"(?<=.)[._]\d+$", "", name)


class UniqueNames:
    """Gives names out, each once."""

    def __init__(self) -> None:
        self._copies: dict[str, int] = {}

    def __call__(self, name: str) -> str:
        """`name`, or `name#2`, `name#3`, ... where that is taken."""
        found = name
        while found in self._copies:
            self._copies[name] += 1
            found = f"{name}#{self._copies[name]}"
        self._copies[found] = 1
        return found


def plain_text(text: str) -> str:
    """`text` as it can be shown and written anywhere: what does not print, and half a character, is replaced."""
    return text if text.isprintable() else "".join(each if each.isprintable() else "\ufffd" for each in text)


def plain_name(name: str) -> str:
    """`plain_text`, cut where it is too long for a name."""
    return plain_text(name) if len(name) <= _LONGEST else plain_text(name[:_LONGEST]) + "…"
