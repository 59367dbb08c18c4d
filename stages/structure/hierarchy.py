"""The groups of the parts of a shape: those that its text or its source names, and rows of congruent parts."""

from __future__ import annotations

from dataclasses import dataclass

from stages.shape.part_joint import PartJoint
from stages.shape.shape import Shape
from stages.structure.groups import named_groups, sibling_rows

ROOT = "shape"
LANGUAGES_OF_KITS = ("kit", "proportions")
"""Languages of samples that are made of the parts of models."""
SEPARATOR = "/"
"""Between the names of nested assemblies in the name of a part."""


@dataclass(frozen=True)
class Hierarchy:
    """A tree of groups with parts as leaves.

    groups: name and parent of each group; parents come first; the root has the parent -1
    part_groups: group of each part
    """

    groups: tuple[tuple[str, int], ...]
    part_groups: tuple[int, ...]


def path_hierarchy(names: tuple[str, ...]) -> Hierarchy:
    """Return the hierarchy of parts that are named by paths, such as `Chair/back/bar`."""
    index_of: dict[str, int] = {"": 0}
    groups = [(names[0].partition(SEPARATOR)[0], -1)]
    part_groups = []
    for name in names:
        path = ""
        for word in name.split(SEPARATOR)[1:-1]:
            parent, path = index_of[path], f"{path}{SEPARATOR}{word}"
            if path not in index_of:
                index_of[path] = len(groups)
                groups.append((word, parent))
        part_groups.append(index_of[path])
    return Hierarchy(tuple(groups), tuple(part_groups))


def moving_hierarchy(shape: Shape) -> Hierarchy:
    """Return the hierarchy of a shape whose parts move together in groups: each group is below the root."""
    groups = [(ROOT, -1)]
    index_of: dict[PartJoint, int] = {}
    part_groups = []
    for joint in shape.part_joints or (None,) * len(shape):
        if joint is not None and joint not in index_of:
            index_of[joint] = len(groups)
            groups.append((f"{joint.kind} {len(index_of)}", 0))
        part_groups.append(0 if joint is None else index_of[joint])
    return Hierarchy(tuple(groups), tuple(part_groups))


def model_hierarchy(shape: Shape) -> Hierarchy:
    """Return the hierarchy of a shape of the parts of models: groups of their node trees, and rows within them."""
    groups, part_groups = [(ROOT, -1)], [0] * len(shape)
    for name, parts in named_groups(shape):
        groups.append((name, part_groups[min(parts)]))
        for part in parts:
            part_groups[part] = len(groups) - 1
    siblings = [[part for part, own in enumerate(part_groups) if own == group] for group in range(len(groups))]
    for group, rows in enumerate(sibling_rows(shape, siblings)):
        for row in rows:
            if len(row) < len(siblings[group]) or any(parent == group for _, parent in groups):
                groups.append((f"row of {shape.labels[shape.part_labels[row[0]]]}", group))
                for part in row:
                    part_groups[part] = len(groups) - 1
    return Hierarchy(tuple(groups), tuple(part_groups))


def hierarchy_of(shape: Shape, language: str) -> Hierarchy:
    """Return the hierarchy of a shape. language: that names its parts, as records call it"""
    if language == "shapeassembly":
        return path_hierarchy(shape.part_names)
    return model_hierarchy(shape) if language in LANGUAGES_OF_KITS else moving_hierarchy(shape)
