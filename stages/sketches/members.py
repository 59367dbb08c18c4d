"""What stage `sketches` adds to every sample."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pipeline.config import Config
from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.collection.members import Field, Member, Members, Packaged, Row
from stages.shape.views.camera import Camera
from stages.sketches.cameras import CAMERA_FIELDS, projected
from stages.sketches.settings import SketchesConfig

__all__ = ["MEMBERS"]

INK = (2e-4, 0.9)
"""How much of a drawing is ink, at least and at most, as a share of a black picture."""
RIGID = 1e-9
"""How far the rotation of a camera may be from one."""


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(SketchesConfig)
    return tuple(
        Member(
            f"sketch{index}.png",
            f"Line drawing of the shape, view `{view.name}`: dark ink on white (0 is black, 255 white), "
            "single-channel PNG. Its camera stands in the record, with OpenCV's axes.",
            "uint8",
            (section.size, section.size),
        )
        for index, view in enumerate(section.views)
    )


def _fields(_: Config) -> Mapping[str, Field]:
    properties = {
        "view": {"description": "its name in the config", "type": "string", "minLength": 1},
        **CAMERA_FIELDS,
        "line_width": {"description": "no line is wider; unit: pixels", "type": "number", "exclusiveMinimum": 0},
    }
    return {
        "sketches": Field(
            {
                "description": "the drawings in their order, each with its camera, as it stood after it was fitted "
                "and jittered and the drawing flipped",
                "type": "array",
                "items": {
                    "type": "object",
                    "properties": properties,
                    "required": list(properties),
                    "additionalProperties": False,
                },
                "minItems": 1,
            }
        )
    }


def _faults(sample: Packaged) -> Iterator[str]:
    corners = np.array(list(itertools.product(*np.transpose(sample.record["bounds"]))))
    for index, camera in enumerate(sample.record["sketches"]):
        name = f"sketch{index}.png"
        for what in _drawing_faults(sample.members[name], camera, corners):
            yield f"{name} {what}"


def _drawing_faults(content: bytes, camera: Mapping[str, Any], corners: FloatArray) -> Iterator[str]:
    """What is wrong with one drawing of a shape in a box with these corners, float64 (8, 3)."""
    from PIL import Image

    pose = np.array(camera["world_to_camera"])
    turn = pose[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > RIGID or np.linalg.det(turn) < 0 or pose[3].tolist() != [0, 0, 0, 1]:
        yield "has a camera whose world_to_camera is no rigid motion"
    if (camera["intrinsics"][0][0] < 0) != camera["flipped"]:
        yield "has a camera whose intrinsics and flipped do not say the same"
    try:
        drawing = np.asarray(Image.open(io.BytesIO(content)))
    except (OSError, SyntaxError, ValueError) as error:
        yield f"cannot be read: {error}"
        return
    if drawing.dtype != np.uint8 or drawing.shape != (camera["height"], camera["width"]):
        yield f"has pixels {drawing.dtype} {drawing.shape}, not those that its record says"
        return
    share = 1.0 - float(drawing.mean()) / 255.0
    if not INK[0] <= share <= INK[1]:
        yield f"is blank or full: {share:.2%} of it is ink"
        return
    seen = projected(camera, corners)
    # A corner of the box may be behind the camera although nothing of the shape is.
    if np.isfinite(seen).all():
        rows, columns = np.nonzero(drawing < 255)
        ink = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
        beyond = max(float((seen.min(axis=0) - ink[0]).max()), float((ink[1] - seen.max(axis=0)).max()))
        if beyond > camera["line_width"] / 2 + 1.0:
            yield f"has ink where its camera does not see the shape, {beyond:.0f} pixels beyond"


def _caption(config: Config) -> str:
    section = config.section(SketchesConfig)
    return f"{len(section.views)} a shape, {section.size} × {section.size}"


def _draw(members: Mapping[str, bytes], _: Camera, __: int) -> ByteArray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(members["sketch0.png"])).convert("L"))


MEMBERS = Members(of=_members, fields=_fields, faults=_faults, row=Row("Sketches", _caption, _draw))
