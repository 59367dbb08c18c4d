"""Arrange a part hierarchy for a program: semantic flattening and collapsing, and the frame of every part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import angle_between, bounding_box, corners_of_box, nearest_axes
from stages.shapeassembly.extraction.category_rules import CategoryRules
from stages.shapeassembly.extraction.hierarchy import Box, PartNode

ALIGNED_DEGREES = 5.0
"""A part that is turned by less against its parent is aligned (shapeassembly §5.1)."""


def leaf_corners(part: PartNode) -> FloatArray:
    """Return the corners of all leaves of a part, float64 (8 n, 3)."""
    return np.concatenate([corners_of_box(leaf.box) for leaf in part.leaves()])


def arrange_parts(root: PartNode, rules: CategoryRules) -> PartNode:
    """Flatten, collapse and regroup the tree by the rules of its category (shapeassembly App. C).

    A node with one child is replaced by it, under the node's label.
    """
    kept, moved = _gathered(root, rules, inside_frame=False)
    if moved:
        assert kept is not None
        kept = _given(kept, tuple(moved), rules.gather_into)
    return _arranged(kept or root, rules)


def _arranged(part: PartNode, rules: CategoryRules) -> PartNode:
    if part.label in rules.collapse:
        return replace(part, children=())
    if part.label in rules.flatten:
        children = tuple(_leaves(part, rules))
    else:
        children = tuple(_arranged(child, rules) for child in part.children)
    if len(children) == 1:
        return replace(children[0], label=part.label)
    return replace(part, children=children)


def _leaves(part: PartNode, rules: CategoryRules) -> list[PartNode]:
    """Return the leaves below a node; collapsed parts count as leaves."""
    leaves: list[PartNode] = []
    for child in part.children:
        if not child.children or child.label in rules.collapse:
            leaves.append(replace(child, children=()))
        else:
            leaves += _leaves(child, rules)
    return leaves


def _gathered(part: PartNode, rules: CategoryRules, *, inside_frame: bool) -> tuple[PartNode | None, list[PartNode]]:
    """Return the part without the nodes that move, and those nodes."""
    if part.label in rules.gather and not inside_frame:
        return None, [part]
    inside_frame |= part.label == rules.gather_into
    results = [_gathered(child, rules, inside_frame=inside_frame) for child in part.children]
    children = tuple(child for child, _ in results if child is not None)
    moved = [node for _, parts in results for node in parts]
    if part.children and not children:
        return None, moved
    return replace(part, children=children), moved


def _given(part: PartNode, moved: tuple[PartNode, ...], label: str) -> PartNode:
    """Add parts below the first node with a label, or below a new child with that label."""

    def place(node: PartNode) -> PartNode | None:
        if node.label == label:
            own = node.children or (node,)
            return replace(node, children=own + moved)
        for index, child in enumerate(node.children):
            changed = place(child)
            if changed is not None:
                return replace(node, children=(*node.children[:index], changed, *node.children[index + 1 :]))
        return None

    return place(part) or replace(part, children=(*part.children, PartNode(label, moved[0].box, moved)))


def frame_parts(root: PartNode) -> PartNode:
    """Give every part the frame that it has in the program.

    The root is upright. Sides are renamed for the smallest rotation against the parent, and an aligned part is turned
    to it. The box of a part with children is the smallest around its leaves in its frame.
    """
    return _framed(root, np.eye(3), root_of_all=True)


def _framed(part: PartNode, frame: FloatArray, *, root_of_all: bool = False) -> PartNode:
    box = nearest_axes(part.box, frame)
    if angle_between(box.axes, frame) < ALIGNED_DEGREES or (
        part.children and (root_of_all or _prefers(part, frame, box))
    ):
        box = Box(box.center, box.size, frame)
    if not part.children:
        return replace(part, box=box)
    children = tuple(_framed(child, box.axes) for child in part.children)
    whole = replace(part, box=box, children=children)
    return replace(whole, box=bounding_box(leaf_corners(whole), box.axes))


def _prefers(part: PartNode, frame: FloatArray, box: Box) -> bool:
    """Return whether more leaves of a part are aligned with `frame` than with its own box."""

    def aligned(axes: FloatArray) -> int:
        angles = [angle_between(nearest_axes(leaf.box, axes).axes, axes) for leaf in part.leaves()]
        return sum(angle < ALIGNED_DEGREES for angle in angles)

    return aligned(frame) >= aligned(box.axes)
