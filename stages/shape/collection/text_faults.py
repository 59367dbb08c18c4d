"""Is a sample that was made from a text what its text says? The shape made anew, beside its GLB and its record."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping

import numpy as np

from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape, upright

__all__ = ["text_faults"]

SINGLE = 1e-6
"""Coordinates in a GLB are 32-bit numbers: as a share of the shape's size they are as near as this."""


def text_faults(made: Shape, members: Mapping[str, bytes]) -> list[str]:
    """What is wrong with the sample whose `members` these are, and whose text makes the shape `made`; an empty list
    where nothing is.

    The text of the record is the member `txt`; the shape has the record's parts and labels, and each of its triangles
    where the GLB, read back with trimesh, has it.
    """
    import trimesh

    record = json.loads(members["json"])
    if members["txt"].decode() != record["text"]:
        return ["its txt and its json hold different texts"]
    shape = upright(made)
    labels = [(name, shape.labels[label]) for name, label in zip(shape.part_names, shape.part_labels, strict=True)]
    if [(part["name"], part["label"]) for part in record["parts"]] != labels:
        return ["its json lists other parts than its text makes"]
    scene = trimesh.load_scene(io.BytesIO(members["glb"]), file_type="glb", process=False)
    near = SINGLE * float(np.abs(shape_bounds(shape)).max())
    faults = []
    for part, name in enumerate(shape.part_names):
        if name not in scene.graph.nodes_geometry:
            faults.append(f"{name} is not in its glb")
            continue
        pose, geometry = scene.graph.get(name)
        found, mesh = scene.geometry[geometry], shape.meshes[shape.assembly.types[part]]
        expected = transform_points(shape.assembly.poses[part], mesh.vertices)[mesh.faces]
        stored = transform_points(np.asarray(pose, dtype=np.float64), found.vertices)[found.faces]
        if stored.shape != expected.shape or np.abs(stored - expected).max() > near:
            faults.append(f"{name} has another surface in its glb than its text makes")
    return faults
