"""Read part hierarchies from the scene graph of a GLB file: nodes are parts, meshes give their boxes."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import (
    MAX_HIERARCHY_DEPTH,
    UNREADABLE,
    PartHierarchy,
    PartNode,
    check_limits,
)
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box

_Z_UP_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

_NUMBER = re.compile(r"[.~_]\d+$")
"""Suffix by which exporters distinguish nodes of one name."""


def read_glb(path: Path, up: Literal["y", "z"]) -> PartHierarchy:
    """Return the hierarchy of the scene graph: each node with a mesh is a leaf with the smallest box.

    up: the axis that points up in the file; the hierarchy is y up.
    The label of a part is its node's name without path and trailing number. Nothing outside the file is read. Raises
    Rejected, naming the file, for an invalid GLB and for one without meshes.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(io.BytesIO(path.read_bytes()), file_type="glb", process=False, skip_materials=True)
        children, root = scene.graph.transforms.children, str(scene.graph.base_frame)
    except Exception:  # trimesh lets through whatever a malformed file makes numpy and json raise
        raise Rejected(UNREADABLE, f"{path.name}: not a whole GLB file; check it with a glTF validator") from None
    rotation = _Z_UP_TO_Y_UP if up == "z" else np.eye(3)
    result = _part(scene, children, root, rotation, path.name, 0)
    if result is None:
        raise Rejected(UNREADABLE, f"{path.name}: no node has a mesh; export the meshes with the scene")
    return PartHierarchy(path.stem, check_limits(result[0], path.name))


def _part(
    scene: Any, tree: Any, node: str, rotation: FloatArray, location: str, depth: int
) -> tuple[PartNode, FloatArray] | None:
    """Return the part of a node and its points, float64 (n, 3) y up; None where no mesh is below it."""
    if depth > MAX_HIERARCHY_DEPTH:
        raise Rejected(UNREADABLE, f"{location}: more than {MAX_HIERARCHY_DEPTH} levels; simplify the scene")
    label = _NUMBER.sub("", node.rsplit("/", 1)[-1]) or "part"
    results = [_part(scene, tree, child, rotation, location, depth + 1) for child in sorted(tree.get(node, []))]
    below = [result for result in results if result is not None]
    matrix, geometry = scene.graph.get(node)
    if geometry is not None:
        vertices = np.asarray(scene.geometry[geometry].vertices, dtype=np.float64)
        points = (vertices @ matrix[:3, :3].T + matrix[:3, 3]) @ rotation.T
        if not len(points) or not np.isfinite(points).all():
            raise Rejected(UNREADABLE, f"{location}: node {node!r} has no vertices, or some that are not finite")
        below.insert(0, (PartNode(label, minimum_box(points)), points))
        if len(below) == 1:
            return below[0]
    if not below:
        return None
    points = np.concatenate([result for _, result in below])
    return PartNode(label, minimum_box(points), tuple(part for part, _ in below)), points
