"""What stage `points` adds to every sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.shards import bytes_array
from stages.points.settings import PointsConfig, ScansConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Member, Members, PreviewRow, RecordField
from stages.shape.views.camera import Camera
from stages.shape.views.camera_record import CAMERA_FIELDS

SCAN = "scan_"
"""Beginning of the names of members of scans."""


def cloud_number(index: int) -> str:
    """Return what the names of the members of cloud `index` end with: nothing for the first."""
    return str(index) if index else ""


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(PointsConfig)
    count = section.uniform + section.farthest
    where = " of what is seen from outside" if section.surface == "visible" else ""
    members: list[Member] = []
    for index in range(section.clouds):
        number = cloud_number(index)
        text = f"Point cloud {number}{where}, drawn independently." if index else f"Point cloud{where}."
        members += _of_cloud("", number, text, count)
    return (*members, *(() if section.scans is None else _of_scans(section.scans)))


def _of_scans(scans: ScansConfig) -> Iterator[Member]:
    for index in range(scans.count):
        text = f"Points that the cameras of scan {index} see: `scans[{index}]` of the record."
        yield from _of_cloud(SCAN, str(index), text, scans.points)
        seen = f"Camera that saw each point of scan {index}, by its place in `scans[{index}].cameras`."
        yield Member(f"{SCAN}cameras{index}.npy", seen, "int16", (scans.points,))


def _of_cloud(prefix: str, number: str, text: str, count: int) -> tuple[Member, ...]:
    if number:
        points = f"of `{prefix}points{number}.npy`"
        normals, labels = f"Unit normals {points}.", f"Class of the part of each point {points}."
        instances = f"Part of each point {points}, by its place in the record."
    else:
        normals = "Unit normals of the points."
        labels = "Class of the part that each point lies on: its id in `classes.json`."
        instances = "Part that each point lies on, by its place in the record."
    return (
        Member(f"{prefix}points{number}.npy", text, "float32", (count, 3)),
        Member(f"{prefix}normals{number}.npy", normals, "float32", (count, 3)),
        Member(f"{prefix}labels{number}.npy", labels, "int16", (count,)),
        Member(f"{prefix}instances{number}.npy", instances, "int16", (count,)),
    )


def _fields(config: Config) -> Mapping[str, RecordField]:
    section = config.section(PointsConfig)
    count = {"type": "integer", "minimum": 0}
    asked: dict[str, Any] = {}
    if section.min_per_part:
        asked["min_per_part"] = {**count, "description": "least number of uniform points on each part"}
    if section.clouds > 1:
        asked["clouds"] = {**count, "minimum": 2, "description": "number of clouds, each made in this way"}
    scans = {} if section.scans is None else {"scans": RecordField(_scan_schema(section.scans))}
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
                    **asked,
                },
                "required": ["farthest", "uniform", "surface", "centre", "scale", *asked],
                "additionalProperties": False,
            }
        ),
        **scans,
    }


def _scan_schema(scans: ScansConfig) -> dict[str, Any]:
    noise = {
        "type": "number",
        "minimum": 0,
        "description": "standard deviation of the noise along the line of sight, in the units of the mesh; cut at 4 "
        "of them",
    }
    camera = {
        "type": "object",
        "properties": CAMERA_FIELDS,
        "required": list(CAMERA_FIELDS),
        "additionalProperties": False,
    }
    cameras = {"type": "array", "items": camera, "minItems": 1, "description": "the cameras, in mesh coordinates"}
    return {
        "description": "the partial clouds: each point is the first surface on a ray through a random place of the "
        "picture of one of the cameras, moved by noise along the ray; coordinates are those of `points`",
        "type": "array",
        "minItems": scans.count,
        "maxItems": scans.count,
        "items": {
            "type": "object",
            "properties": {"depth_noise": noise, "cameras": cameras},
            "required": ["depth_noise", "cameras"],
            "additionalProperties": False,
        },
    }


def _caption(config: Config) -> str:
    section = config.section(PointsConfig)
    visible = ", on what is seen from outside" if section.surface == "visible" else ""
    return f"{section.uniform + section.farthest:,} a shape{visible}, coloured by part label"


def _scan_caption(config: Config) -> str:
    scans = config.section(PointsConfig).scans
    if scans is None:
        return ""
    cameras = scans.camera_count
    seen = "a camera sees" if cameras == 1 else f"{cameras} cameras see"
    return f"{scans.points:,} a scan of what {seen}, coloured by part label"


def _draw(members: Mapping[str, bytes], camera: Camera, size: int) -> ByteArray:
    return _portrait(members, "points.npy", "labels.npy", camera, size)


def _draw_scan(members: Mapping[str, bytes], camera: Camera, size: int) -> ByteArray:
    return _portrait(members, f"{SCAN}points0.npy", f"{SCAN}labels0.npy", camera, size)


def _portrait(members: Mapping[str, bytes], points_name: str, labels_name: str, camera: Camera, size: int) -> ByteArray:
    from stages.shape.views.portrait import points_portrait

    points, labels = bytes_array(members[points_name]), bytes_array(members[labels_name])
    return points_portrait(points.astype(np.float64), labels.astype(np.int32), camera, (size, size), "y")


def _limits(config: Config) -> Sequence[str]:
    section = config.section(PointsConfig)
    visible = section.surface == "visible"
    limits = [
        "Points cover only what is seen from outside in 64 directions, without noise, unlike a scan."
        if visible
        else "Points cover the whole surface of every part, even where it is hidden inside another part, unlike a scan."
    ]
    if section.min_per_part:
        which = "that is seen well " if visible else ""
        limits.append(
            f"Points are not uniform by area: each part {which}has at least the `points.min_per_part` points of the "
            "record."
        )
    if section.scans is not None:
        limits.append(_scan_limit(section.scans))
    return limits


def _scan_limit(scans: ScansConfig) -> str:
    if not scans.depth_noise:
        return "Scans have no noise and no outliers."
    return (
        "The noise of scans is normal, independent, and along the line of sight only, with a standard deviation of "
        f"{scans.depth_noise:g} radii of the bounding sphere. Scans have no outliers."
    )


def _coordinates(config: Config) -> Sequence[str]:
    section = config.section(PointsConfig)
    if section.normalize == "none":
        points = "Points have the coordinates of the mesh, so that sizes and units are kept."
    else:
        points = "Points are moved and scaled: (coordinates of the mesh - `points.centre`) * `points.scale`."
    return (points,) if section.scans is None else (points, "Scans have the coordinates of the points.")


def _rows(config: Config) -> Sequence[PreviewRow]:
    points = PreviewRow("Points", _caption, _draw)
    scanned = config.section(PointsConfig).scans is not None
    return (points, PreviewRow("Scans", _scan_caption, _draw_scan)) if scanned else (points,)


MEMBERS = Members(
    of=_members,
    fields=_fields,
    rows=_rows,
    limits=_limits,
    coordinates=_coordinates,
)
