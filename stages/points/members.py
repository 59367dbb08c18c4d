"""What stage `points` adds to every sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pipeline.config import Config
from pipeline.shards import bytes_array
from stages.points.settings import PointsConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Field, Member, Members, Packaged, Row
from stages.shape.views.camera import Camera

__all__ = ["MEMBERS"]

SINGLE = 1e-5
"""How far 32-bit numbers may be off, as a share of the largest that they were made of."""


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(PointsConfig)
    count = section.uniform + section.farthest
    return (
        Member("points.npy", "Point cloud.", "float32", (count, 3)),
        Member("normals.npy", "Unit normals of the points.", "float32", (count, 3)),
        Member("labels.npy", "Class of the part that each point lies on: its id in `classes.json`.", "int16", (count,)),
        Member("instances.npy", "Part that each point lies on, by its place in the record.", "int16", (count,)),
    )


def _fields(_: Config) -> Mapping[str, Field]:
    count = {"type": "integer", "minimum": 0}
    return {
        "points": Field(
            {
                "description": "how the cloud was made: the first `farthest` points are picked farthest first, the "
                "others drawn by area; (coordinates of the mesh - centre) * scale are those of the points",
                "type": "object",
                "properties": {
                    "farthest": count,
                    "uniform": count,
                    "centre": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
                    "scale": {"type": "number", "exclusiveMinimum": 0},
                },
                "required": ["farthest", "uniform", "centre", "scale"],
                "additionalProperties": False,
            }
        )
    }


def _faults(sample: Packaged) -> Iterator[str]:
    points, normals = sample.arrays["points.npy"].astype(np.float64), sample.arrays["normals.npy"].astype(np.float64)
    labels, instances = sample.arrays["labels.npy"], sample.arrays["instances.npy"]
    made, bounds = sample.record["points"], np.array(sample.record["bounds"])
    if {len(points), len(normals), len(labels), len(instances)} != {made["farthest"] + made["uniform"]}:
        yield "its point arrays have other lengths than its json counts"
        return
    classes = np.array([part["class"] for part in sample.record["parts"]])
    if instances.min() < 0 or instances.max() >= len(classes):
        yield "its points name parts that are not there"
    elif (classes[instances] != labels).any():
        yield "its point labels are not the classes of their parts"
    if not (np.isfinite(points).all() and np.isfinite(normals).all()):
        yield "its points or normals are not finite"
        return
    if np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() > SINGLE:
        yield "its normals are not of unit length"
    placed = points / made["scale"] + made["centre"]
    beyond = float(np.maximum(bounds[0] - placed, placed - bounds[1]).max())
    if beyond > SINGLE * float(np.abs(bounds).max()):
        yield f"its points reach {beyond:.3g} out of its bounds"


def _caption(config: Config) -> str:
    section = config.section(PointsConfig)
    return f"{section.uniform + section.farthest:,} a shape, coloured by part label"


def _draw(members: Mapping[str, bytes], camera: Camera, size: int) -> ByteArray:
    from stages.shape.views.portrait import points_portrait

    points, labels = bytes_array(members["points.npy"]), bytes_array(members["labels.npy"])
    return points_portrait(points.astype(np.float64), labels.astype(np.int32), camera, (size, size), "y")


MEMBERS = Members(of=_members, fields=_fields, faults=_faults, row=Row("Points", _caption, _draw))
