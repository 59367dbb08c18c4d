"""Read PartNet shapes: `result_after_merging.json` with the meshes of the parts in `objs/`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from stages.model_files.exact_vertices import exact_vertices
from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import (
    MAX_HIERARCHY_DEPTH,
    UNREADABLE,
    PartHierarchy,
    PartNode,
    check_limits,
)
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box
from stages.shapeassembly.extraction.readers.model import read_model_scene


def read_partnet(path: Path) -> PartHierarchy:
    """Return the hierarchy of a PartNet file, named by its folder; a part's box is the smallest around its meshes.

    The file is a list with one tree of `{"name", "children"}` nodes; a leaf names its meshes in `objs`, the files
    `objs/<name>.obj` in the same folder. Raises Rejected, naming file and part, for anything else.
    """
    try:
        trees = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise Rejected(UNREADABLE, f"{path.name}: not JSON ({type(error).__name__}); download it again") from None
    if not isinstance(trees, list) or len(trees) != 1:
        raise Rejected(UNREADABLE, f"{path.name}: a PartNet hierarchy is a list with one tree")
    name = path.resolve().parent.name
    root, _ = _part(trees[0], path.parent / "objs", path.name, 0)
    return PartHierarchy(name, check_limits(root, name))


def _part(node: Any, folder: Path, location: str, depth: int) -> tuple[PartNode, FloatArray]:
    """Return a part and the points of its meshes, float64 (n, 3)."""
    if depth > MAX_HIERARCHY_DEPTH or not isinstance(node, dict):
        raise Rejected(UNREADABLE, f"{location}: a part is an object, at most {MAX_HIERARCHY_DEPTH} levels deep")
    label = node.get("name")
    if not isinstance(label, str) or not label:
        raise Rejected(UNREADABLE, f"{location}: a part has no `name`")
    here = f"{location}/{label}"
    children, meshes = node.get("children") or [], node.get("objs") or []
    if not isinstance(children, list) or not isinstance(meshes, list):
        raise Rejected(UNREADABLE, f"{here}: `children` and `objs` are lists")
    if children:
        parts = [_part(child, folder, here, depth + 1) for child in children]
        points = np.concatenate([part_points for _, part_points in parts])
        return PartNode(label, minimum_box(points), tuple(part for part, _ in parts)), points
    if not meshes:
        raise Rejected(UNREADABLE, f"{here}: a leaf names its meshes in `objs`")
    points = np.concatenate([_points(mesh, folder, here) for mesh in meshes])
    return PartNode(label, minimum_box(points)), points


def _points(mesh: Any, folder: Path, location: str) -> FloatArray:
    """Return the vertices on the faces of one OBJ file, float64 (n, 3)."""
    if not isinstance(mesh, str) or not mesh or set(mesh) & set("/\\\0") or mesh in {".", ".."}:
        raise Rejected(UNREADABLE, f"{location}: a mesh is named by a file of `objs`, without a folder: {mesh!r}")
    path = folder / f"{mesh}.obj"
    if not path.is_file():
        raise Rejected(UNREADABLE, f"{location}: objs/{mesh}.obj is not there; download the shape again")
    try:
        scene = read_model_scene(path)
    except Rejected as error:
        raise Rejected(UNREADABLE, f"{location}: objs/{error.detail}") from None
    return np.concatenate(exact_vertices(scene))
