"""What stage `sketches` adds to every sample."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np

from pipeline.config import Config
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Member, Members, PreviewRow, RecordField
from stages.shape.views.camera import Camera
from stages.shape.views.camera_record import CAMERA_FIELDS
from stages.sketches.settings import SketchesConfig


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


def _fields(_: Config) -> Mapping[str, RecordField]:
    properties = {
        "view": {"description": "its name in the config", "type": "string", "minLength": 1},
        **CAMERA_FIELDS,
        "flipped": {
            "description": "whether left and right are mirrored; intrinsics account for it",
            "type": "boolean",
        },
        "line_width": {"description": "no line is wider; unit: pixels", "type": "number", "exclusiveMinimum": 0},
    }
    return {
        "sketches": RecordField(
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


def _caption(config: Config) -> str:
    section = config.section(SketchesConfig)
    return f"{len(section.views)} a shape, {section.size} × {section.size}"


def _draw(members: Mapping[str, bytes], _: Camera, __: int) -> ByteArray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(members["sketch0.png"])).convert("L"))


MEMBERS = Members(
    of=_members,
    fields=_fields,
    rows=lambda _: (PreviewRow("Sketches", _caption, _draw),),
    checks=("drawings",),
    tasks=lambda _: ("image-to-3d",),
)
