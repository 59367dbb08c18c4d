"""Forms symmetry groups in a node: one part stands for all that a macro makes of it (shapeassembly App. C)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.arrangement import leaf_corners
from stages.shapeassembly.extraction.boxes import around, box_corners
from stages.shapeassembly.extraction.hierarchy import Part
from stages.shapeassembly.extraction.layout import Layout, lay_out
from stages.shapeassembly.extraction.symmetry import Body, Group, reflections, translations

__all__ = ["Symmetry", "form_groups"]

BOTTOM, TOP = -1, -2

REFLECTION_AXES = (0, 2, 1)
"""Left and right first, then front and back, then bottom and top."""


@dataclass(frozen=True)
class Symmetry:
    """A macro on one part. copies: parts beside the first; distance: of the last copy, as a share of the box along
    `axis`, for a translation; None for a reflection."""

    axis: int
    copies: int
    distance: float | None


def form_groups(layout: Layout, order: Callable[[Part], object]) -> tuple[Layout, list[Symmetry | None]]:
    """The layout of the parts that remain when groups are formed, and for each the macro that makes the others.

    Connected components that repeat become one sub-part each, before groups of single parts are formed. `order` is
    the key of the canonical order of parts.
    """
    found: dict[int, Symmetry] = {}
    pooled = _pool_components(layout)
    while pooled is not None:
        parts, macro, chosen = pooled
        ordered = sorted(range(len(parts)), key=lambda i: order(parts[i]))
        known = {id(part): found[i] for i, part in enumerate(layout.parts) if i in found}
        known[id(chosen)] = macro
        layout = lay_out([parts[i] for i in ordered], layout.bbox.size)
        found = {i: known[id(part)] for i, part in enumerate(layout.parts) if id(part) in known}
        pooled = _pool_components(layout, set(found))
    singles = [i for i in range(len(layout.parts)) if i not in found]
    bodies = _bodies(layout, [(i,) for i in singles])
    removed: set[int] = set()
    for group in _single_groups(bodies, layout.diagonal):
        members = [bodies[each].members[0] for each in group.bodies]
        found[members[0]] = _macro(group, layout)
        removed |= set(members[1:])
    kept = [i for i in range(len(layout.parts)) if i not in removed]
    return _without(layout, kept), [found.get(i) for i in kept]


def _single_groups(bodies: Sequence[Body], diagonal: float) -> list[Group]:
    """Groups of single parts: rows of three or more, then mirrored pairs, then rows of two."""
    searches: list[Callable[[Sequence[Body]], list[Group]]] = [
        *(lambda some, axis=axis: translations(some, axis, diagonal, 3) for axis in range(3)),
        *(lambda some, axis=axis: reflections(some, axis, diagonal) for axis in REFLECTION_AXES),
        *(lambda some, axis=axis: translations(some, axis, diagonal, 2) for axis in range(3)),
    ]
    groups: list[Group] = []
    taken: set[int] = set()
    for search in searches:
        free = [i for i in range(len(bodies)) if i not in taken]
        for group in search([bodies[i] for i in free]):
            members = tuple(free[i] for i in group.bodies)
            groups.append(Group(group.kind, group.axis, members, group.distance))
            taken |= set(members)
    return groups


def _pool_components(layout: Layout, fixed: set[int] | None = None) -> tuple[list[Part], Symmetry, Part] | None:
    """The parts after one group of connected components has become one sub-part, with its macro and the sub-part."""
    free = [i for i in range(len(layout.parts)) if i not in (fixed or set())]
    singles = _bodies(layout, [(i,) for i in free])
    blind = [Body(body.members, body.boxes, frozenset()) for body in singles]
    for kind, axis in [*(("reflect", axis) for axis in REFLECTION_AXES), *(("translate", axis) for axis in range(3))]:
        paired = (
            reflections(blind, axis, layout.diagonal)
            if kind == "reflect"
            else translations(blind, axis, layout.diagonal, 2)
        )
        moving = sorted({free[body] for group in paired for body in group.bodies})
        components = [each for each in _components(layout, moving) if len(each) > 1]
        if len(components) < 2:
            continue
        bodies = _bodies(layout, components)
        groups = (
            reflections(bodies, axis, layout.diagonal)
            if kind == "reflect"
            else translations(bodies, axis, layout.diagonal, 2)
        )
        if groups:
            group = groups[0]
            gone = {member for body in group.bodies for member in bodies[body].members}
            pooled = _pool([layout.parts[i] for i in bodies[group.bodies[0]].members])
            kept = [part for i, part in enumerate(layout.parts) if i not in gone]
            return [*kept, pooled], _macro(group, layout), pooled
    return None


def _pool(parts: Sequence[Part]) -> Part:
    """One part that is made of `parts`, in a box along the node's frame."""
    corners = np.concatenate([leaf_corners(part) for part in parts])
    return Part(parts[0].label, around(corners, np.eye(3)), tuple(parts))


def _macro(group: Group, layout: Layout) -> Symmetry:
    if group.kind == "reflect":
        return Symmetry(group.axis, 1, None)
    return Symmetry(group.axis, len(group.bodies) - 1, group.distance / float(layout.bbox.size[group.axis]))


def _bodies(layout: Layout, members: Sequence[Sequence[int]]) -> list[Body]:
    """The given sets of parts as bodies."""
    bodies = []
    for each in members:
        touches = {j for i in each for j in layout.neighbours(i)} - set(each)
        touches |= {BOTTOM for i in each if layout.bottoms[i] is not None}
        touches |= {TOP for i in each if layout.tops[i] is not None}
        boxes: tuple[FloatArray, ...] = tuple(box_corners(leaf.box) for i in each for leaf in layout.parts[i].leaves())
        bodies.append(Body(tuple(each), boxes, frozenset(touches)))
    return bodies


def _components(layout: Layout, parts: Sequence[int]) -> list[list[int]]:
    """The sets of `parts` that hang together through contacts, each ascending."""
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


def _without(layout: Layout, kept: Sequence[int]) -> Layout:
    """The layout of the parts `kept`, ascending."""
    place = {part: index for index, part in enumerate(kept)}
    contacts = {(place[i], place[j]): each for (i, j), each in layout.contacts.items() if i in place and j in place}
    return Layout(
        layout.bbox,
        tuple(layout.parts[i] for i in kept),
        contacts,
        tuple(layout.bottoms[i] for i in kept),
        tuple(layout.tops[i] for i in kept),
    )
