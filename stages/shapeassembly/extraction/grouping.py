"""Form symmetry groups in a node: one part represents all that a macro makes of it (shapeassembly App. C)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.arrangement import leaf_corners
from stages.shapeassembly.extraction.boxes import bounding_box, corners_of_box
from stages.shapeassembly.extraction.hierarchy import PartNode
from stages.shapeassembly.extraction.node_layout import NodeLayout, layout_parts
from stages.shapeassembly.extraction.symmetry import (
    BOTTOM_END,
    TOP_END,
    SymmetryBody,
    SymmetryGroup,
    reflections,
    translations,
)

REFLECTION_AXES = (0, 2, 1)
"""Left and right first, then front and back, then bottom and top."""


@dataclass(frozen=True)
class SymmetryMacro:
    """A macro on one part.

    copies: parts besides the first.
    distance: of the last copy, as a share of the box along `axis`; None for a reflection.
    """

    axis: int
    copies: int
    distance: float | None


@dataclass(frozen=True)
class _Formed:
    """A group.

    part: the part that represents it.
    anchors: the parts that all members are attached to.
    ends: the ends of the bounding box that all members reach.
    """

    part: PartNode
    symmetry: SymmetryMacro
    anchors: tuple[PartNode, ...]
    ends: frozenset[int]


def form_groups(
    layout: NodeLayout, order: Callable[[PartNode], Any], *, strict: bool, pool: bool
) -> tuple[NodeLayout, list[SymmetryMacro | None]]:
    """Return the layout without the parts that macros make, and the macro of each remaining part.

    order: sort key of parts.
    strict: members of a group must be attached alike.
    pool: first merge repeated connected components into one sub-part each.
    A part with a macro is anchored to what all its copies are attached to.
    """
    formed: list[_Formed] = []
    while pool and (pooled := _pool_components(layout, {id(group.part) for group in formed}, strict)) is not None:
        parts, merged = pooled
        formed.append(merged)
        layout = layout_parts(sorted(parts, key=order), layout.bbox.size)
    fixed = {id(group.part) for group in formed}
    bodies = _bodies(layout, [(i,) for i, part in enumerate(layout.parts) if id(part) not in fixed])
    groups = _single_groups(bodies, layout.diagonal, strict)
    while True:
        members = [tuple(bodies[i].members[0] for i in group.bodies) for group in groups]
        gone = {part for _, *copies in members for part in copies}
        singles = [
            _formed(group, layout, layout.parts[of_group[0]]) for group, of_group in zip(groups, members, strict=True)
        ]
        kept = [i for i in range(len(layout.parts)) if i not in gone]
        reduced, macros = _reduced(layout, kept, [*formed, *singles])
        loose = {kept[i] for i in reduced.ungroundable()}
        if not loose or not groups:
            return reduced, macros
        del groups[_at_fault(layout, members, loose)]


def _at_fault(layout: NodeLayout, members: Sequence[tuple[int, ...]], loose: set[int]) -> int:
    """Return the group to dissolve so that loose parts can be grounded:

    the last one that is loose, or touches a loose part.
    """
    affected = loose | {other for part in loose for other in layout.neighbours(part)}
    for wanted in (loose, affected):
        for index in reversed(range(len(members))):
            if wanted & set(members[index]):
                return index
    return len(members) - 1


def _searches(
    diagonal: float, min_length: int, strict: bool
) -> list[Callable[[Sequence[SymmetryBody]], list[SymmetryGroup]]]:
    """Return searches for groups along each axis: mirrored pairs, then rows of at least `min_length`."""
    return [
        *(partial(reflections, axis=axis, diagonal=diagonal, strict=strict) for axis in REFLECTION_AXES),
        *(
            partial(translations, axis=axis, diagonal=diagonal, min_length=min_length, strict=strict)
            for axis in range(3)
        ),
    ]


def _single_groups(bodies: Sequence[SymmetryBody], diagonal: float, strict: bool) -> list[SymmetryGroup]:
    """Return groups of single parts: rows of three or more, then mirrored pairs, then rows of two."""
    long_rows = _searches(diagonal, 3, strict)[len(REFLECTION_AXES) :]
    groups: list[SymmetryGroup] = []
    taken: set[int] = set()
    for search in (*long_rows, *_searches(diagonal, 2, strict)):
        free = [i for i in range(len(bodies)) if i not in taken]
        for group in search([bodies[i] for i in free]):
            members = tuple(free[i] for i in group.bodies)
            groups.append(replace(group, bodies=members))
            taken |= set(members)
    return groups


def _pool_components(layout: NodeLayout, fixed: set[int], strict: bool) -> tuple[list[PartNode], _Formed] | None:
    """Merge one group of connected components into a sub-part. Returns the remaining parts, and the group.

    fixed: identities of the parts that are groups already.
    """
    free = [i for i, part in enumerate(layout.parts) if id(part) not in fixed]
    bodies = _bodies(layout, [(i,) for i in free])
    unattached = [replace(body, joints=((BOTTOM_END, body.center), (TOP_END, body.center))) for body in bodies]
    for find in _searches(layout.diagonal, 2, strict):
        moving = sorted({free[i] for group in find(unattached) for i in group.bodies})
        bodies = _bodies(layout, [component for component in _components(layout, moving) if len(component) > 1])
        groups = find(bodies)
        if groups:
            first, *others = (bodies[i].members for i in groups[0].bodies)
            pooled = _pool([layout.parts[i] for i in first])
            gone = {member for members in (first, *others) for member in members}
            kept = [part for i, part in enumerate(layout.parts) if i not in gone]
            return [*kept, pooled], _formed(groups[0], layout, pooled)
    return None


def _pool(parts: Sequence[PartNode]) -> PartNode:
    """Return one part that is made of `parts`, in a box along the node's frame."""
    corners = np.concatenate([leaf_corners(part) for part in parts])
    return PartNode(parts[0].label, bounding_box(corners, np.eye(3)), tuple(parts))


def _formed(group: SymmetryGroup, layout: NodeLayout, part: PartNode) -> _Formed:
    copies, distance = 1, None
    if group.kind == "translate":
        copies, distance = len(group.bodies) - 1, group.distance / float(layout.bbox.size[group.axis])
    anchors = tuple(layout.parts[i] for i in sorted(group.anchors) if i >= 0)
    return _Formed(part, SymmetryMacro(group.axis, copies, distance), anchors, group.anchors & {BOTTOM_END, TOP_END})


def _bodies(layout: NodeLayout, members: Sequence[Sequence[int]]) -> list[SymmetryBody]:
    """Return the given sets of parts as bodies."""
    bodies = []
    for indices in members:
        boxes: tuple[FloatArray, ...] = tuple(
            corners_of_box(leaf.box) for i in indices for leaf in layout.parts[i].leaves()
        )
        bodies.append(SymmetryBody(tuple(indices), boxes, tuple(_joints(layout, indices))))
    return bodies


def _joints(layout: NodeLayout, members: Sequence[int]) -> Iterator[tuple[int, FloatArray]]:
    """Yield the attachments of a set of parts to other parts, with their points."""
    for i in members:
        for j in layout.neighbours(i):
            if j not in members:
                yield j, layout.points(i, j)[0]
        for end, point in ((BOTTOM_END, layout.bottoms[i]), (TOP_END, layout.tops[i])):
            if point is not None:
                yield end, point


def _components(layout: NodeLayout, parts: Sequence[int]) -> list[list[int]]:
    """Return the connected components of `parts`, each ascending."""
    left, components = set(parts), []
    for seed in parts:
        if seed not in left:
            continue
        left.discard(seed)
        frontier, component = [seed], [seed]
        while frontier:
            fresh = sorted(left & set(layout.neighbours(frontier.pop())))
            left -= set(fresh)
            frontier += fresh
            component += fresh
        components.append(sorted(component))
    return components


def _reduced(
    layout: NodeLayout, kept: Sequence[int], formed: Sequence[_Formed]
) -> tuple[NodeLayout, list[SymmetryMacro | None]]:
    """Return the layout of the parts `kept`, ascending, with groups anchored, and the macro of each."""
    new_index = {part: index for index, part in enumerate(kept)}
    named = {id(layout.parts[part]): index for part, index in new_index.items()}
    groups = {named[id(group.part)]: group for group in formed}
    anchors: list[frozenset[int] | None] = [None] * len(kept)
    bottoms, tops = [layout.bottoms[i] for i in kept], [layout.tops[i] for i in kept]
    for index, group in groups.items():
        anchors[index] = frozenset(named[id(part)] for part in group.anchors if id(part) in named)
        bottoms[index] = bottoms[index] if BOTTOM_END in group.ends else None
        tops[index] = tops[index] if TOP_END in group.ends else None
    reduced = NodeLayout(
        layout.bbox,
        tuple(layout.parts[i] for i in kept),
        {
            (new_index[i], new_index[j]): contact
            for (i, j), contact in layout.contacts.items()
            if i in new_index and j in new_index
        },
        tuple(bottoms),
        tuple(tops),
        tuple(anchors),
    )
    return reduced, [groups[i].symmetry if i in groups else None for i in range(len(kept))]
