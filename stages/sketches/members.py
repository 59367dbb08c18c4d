"""What stage `sketches` adds to every sample."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np

from pipeline.config import Config
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Field, Member, Members, Row
from stages.shape.views.camera import Camera
from stages.sketches.settings import SketchesConfig

__all__ = ["MEMBERS"]


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(SketchesConfig)
    return tuple(
        Member(
            f"sketch{index}.png",
            f"Line drawing of the shape, view `{view.name}`, dark on white, single-channel PNG.",
            "uint8",
            (section.size, section.size),
        )
        for index, view in enumerate(section.views)
    )


def _fields(_: Config) -> Mapping[str, Field]:
    return {
        "sketches": Field(
            {
                "description": "names of the views, in the order of the drawings",
                "type": "array",
                "items": {"type": "string"},
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


MEMBERS = Members(of=_members, fields=_fields, row=Row("Sketches", _caption, _draw))
