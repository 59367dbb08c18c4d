"""What stage `points` adds to every sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.config import Config
from pipeline.shards import bytes_array
from stages.points.settings import PointsConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Member, Members, PreviewRow, RecordField
from stages.shape.views.camera import Camera

POINTS = {"all": "Point cloud.", "visible": "Point cloud of what is seen from outside."}


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(PointsConfig)
    count = section.uniform + section.farthest
    return (
        Member("points.npy", POINTS[section.surface], "float32", (count, 3)),
        Member("normals.npy", "Unit normals of the points.", "float32", (count, 3)),
        Member("labels.npy", "Class of the part that each point lies on: its id in `classes.json`.", "int16", (count,)),
        Member("instances.npy", "Part that each point lies on, by its place in the record.", "int16", (count,)),
    )


def _fields(_: Config) -> Mapping[str, RecordField]:
    count = {"type": "integer", "minimum": 0}
    return {
        "points": RecordField(
            {
                "description": "how the cloud was made: the first `farthest` points are picked farthest first, the "
                "others drawn by area; of a `visible` surface only what is seen from outside; (coordinates of "
                "the mesh - centre) * scale are those of the points",
                "type": "object",
                "properties": {
                    "farthest": count,
                    "uniform": count,
                    "surface": {"enum": ["all", "visible"]},
                    "centre": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
                    "scale": {"type": "number", "exclusiveMinimum": 0},
                },
                "required": ["farthest", "uniform", "surface", "centre", "scale"],
                "additionalProperties": False,
            }
        )
    }


def _caption(config: Config) -> str:
    section = config.section(PointsConfig)
    visible = ", on what is seen from outside" if section.surface == "visible" else ""
    return f"{section.uniform + section.farthest:,} a shape{visible}, coloured by part label"


def _draw(members: Mapping[str, bytes], camera: Camera, size: int) -> ByteArray:
    from stages.shape.views.portrait import points_portrait

    points, labels = bytes_array(members["points.npy"]), bytes_array(members["labels.npy"])
    return points_portrait(points.astype(np.float64), labels.astype(np.int32), camera, (size, size), "y")


def _limits(config: Config) -> Sequence[str]:
    if config.section(PointsConfig).surface == "visible":
        return ("Points cover only what is seen from outside in 64 directions, without noise, unlike a scan.",)
    return (
        "Points cover the whole surface of every part, even where it is hidden inside another part, unlike a scan.",
    )


def _coordinates(config: Config) -> Sequence[str]:
    if config.section(PointsConfig).normalize == "none":
        return ("Points have the coordinates of the mesh.",)
    return ("Points are moved and scaled: (coordinates of the mesh - `points.centre`) * `points.scale`.",)


MEMBERS = Members(
    of=_members,
    fields=_fields,
    rows=lambda _: (PreviewRow("Points", _caption, _draw),),
    limits=_limits,
    coordinates=_coordinates,
)
