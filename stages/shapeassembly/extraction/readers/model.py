"""Read part hierarchies from model files: nodes, objects or connected components are parts, meshes give their boxes."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.errors import ConfigError, Rejected
from stages.exemplars.segmentation import segment_scene
from stages.model_files.exact_vertices import exact_vertices
from stages.model_files.limits import ReadLimits
from stages.model_files.scene import ModelScene
from stages.model_files.scene_file import check_size, read_scene
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

ORDER_STEPS = 1000
"""Steps of the longest side to which centres are rounded where parts are put in order."""


def read_model_hierarchy(path: Path, up: Literal["auto", "y", "z"]) -> PartHierarchy:
    """Return the hierarchy of a model file: each node with a mesh is a leaf with the smallest box.

    A file without a node tree has a root with its objects, and a file with a single mesh one with its connected
    components. Parts are ordered from the ground up, so that every format gives the same hierarchy.
    up: the axis that points up in the file; `auto`: what the file says, else y. The hierarchy is y up.
    The label of a part is its name without path and trailing number. Nothing outside the folder of the file is read.
    Raises Rejected, naming the file, for one that cannot be read and for one without meshes.
    """
    scene = read_model_scene(path)
    if len(scene.placements) == 1:
        scene = segment_scene(scene, "components")
    turn = _Z_UP_TO_Y_UP if (up if up != "auto" else scene.up) == "z" else np.eye(3)
    root = _tree(scene, turn)
    if len(root.children) == 1:
        root = root.children[0]
    unit = float(np.ptp(root.all_points(), axis=0).max()) / ORDER_STEPS or 1.0
    return PartHierarchy(path.stem, check_limits(_part(root, unit, path.name, 0)[0], path.name))


def read_model_scene(path: Path) -> ModelScene:
    """Return the scene of a model file, in the calling process. Raises Rejected, naming the file."""
    try:
        scene = read_scene(path)
        check_size(path, scene, ReadLimits())
    except ConfigError as error:
        raise Rejected(UNREADABLE, str(error).replace(str(path), path.name, 1)) from None
    return scene


@dataclass
class _Branch:
    """A node with the points of its own meshes, float64 (n, 3) y up each. label: None for a root without a name."""

    label: str | None
    points: list[FloatArray] = field(default_factory=list)
    children: list[_Branch] = field(default_factory=list)

    def all_points(self) -> FloatArray:
        stack, points = [self], []
        while stack:
            branch = stack.pop()
            points += branch.points
            stack += branch.children
        return np.concatenate(points)


def _tree(scene: ModelScene, turn: FloatArray) -> _Branch:
    """Return a root without a name above the nodes of a scene; above its placements if it has no nodes."""
    root = _Branch(None)
    nodes = scene.nodes if all(placement.node is not None for placement in scene.placements) else ()
    branches = [_Branch(_label(node.name)) for node in nodes]
    for node, branch in zip(nodes, branches, strict=True):
        (root if node.parent < 0 else branches[node.parent]).children.append(branch)
    for placement, vertices in zip(scene.placements, exact_vertices(scene), strict=True):
        points = vertices @ turn.T
        if nodes and placement.node is not None:
            branches[placement.node].points.append(points)
        else:
            root.children.append(_Branch(_label(placement.label or "part"), [points]))
    return root


def _label(name: str) -> str:
    return _NUMBER.sub("", name.rsplit("/", 1)[-1]) or "part"


def _part(branch: _Branch, unit: float, location: str, depth: int) -> tuple[PartNode, FloatArray]:
    """Return the part of a branch and its points, float64 (n, 3)."""
    if depth > MAX_HIERARCHY_DEPTH:
        raise Rejected(UNREADABLE, f"{location}: more than {MAX_HIERARCHY_DEPTH} levels; simplify the scene")
    label = branch.label or "root"
    below = [_part(child, unit, location, depth + 1) for child in branch.children]
    if branch.points:
        own = np.concatenate(branch.points)
        below.append((PartNode(label, minimum_box(own)), own))
        if len(below) == 1:
            return below[0]
    below.sort(key=lambda part: _place(part[1], unit))
    points = np.concatenate([part_points for _, part_points in below])
    return PartNode(label, minimum_box(points), tuple(part for part, _ in below)), points


def _place(points: FloatArray, unit: float) -> tuple[float, ...]:
    """Return height, x and z of the middle of some points, and their sizes, in units."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, z = np.rint((low + high) / 2 / unit).tolist()
    return (y, x, z, *np.rint((high - low) / unit).tolist())
