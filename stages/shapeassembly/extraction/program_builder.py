"""Build a program from layouts: the lines of every node, and the names of its assemblies."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pipeline.errors import Rejected
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.extraction.grounding import ground_parts
from stages.shapeassembly.extraction.grouping import SymmetryMacro, form_groups
from stages.shapeassembly.extraction.hierarchy import PartNode
from stages.shapeassembly.extraction.joints import part_name
from stages.shapeassembly.extraction.node_layout import in_frame, layout_parts
from stages.shapeassembly.extraction.tilted import declaration_of, tilted_placer
from stages.shapeassembly.syntax.checks import MAX_CUBOIDS
from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Reflect,
    Squeeze,
    Translate,
)

MAX_CHILDREN = 100
"""Parts of one node before groups are formed; all pairs of them are compared."""

PartOrder = Callable[[PartNode], tuple[Any, ...]]
"""Sort key of the parts of one node, in the node's frame."""


GroupMode = Literal["alike", "common", "none"]
"""Which repeated parts form a group: those attached alike to the same parts (shapeassembly App. C), those attached to a
common part, or none.
"""


@dataclass(frozen=True)
class _Node:
    """The block of a node, whose parts are named by index, and the parts to expand, by name."""

    block: Block
    expanded: dict[str, PartNode]


def build_program(root: PartNode, order: PartOrder, groups: GroupMode, pool: bool) -> AssemblyProgram:
    """Return the program of an arranged hierarchy, root first, assemblies numbered breadth first.

    groups: which repeated parts are made by macros.
    pool: whether parts that repeat together are merged into an assembly.
    Raises Rejected where the parts of a node are not connected, or too many.
    """
    blocks: list[Block] = []
    waiting = deque([root])
    count = 0
    while waiting:
        node = _build_node(waiting.popleft(), order, groups, pool)
        names = {}
        for name, part in node.expanded.items():
            count += 1
            names[name] = f"Program_{count}"
            waiting.append(part)
        lines = tuple(_renamed(line, names) for line in node.block.lines)
        blocks.append(Block(f"Program_{len(blocks)}", node.block.bbox, lines))
    return AssemblyProgram(tuple(blocks))


def _build_node(part: PartNode, order: PartOrder, groups: GroupMode, pool: bool) -> _Node:
    children = sorted((in_frame(child, part.box) for child in part.children), key=order)
    if len(children) > MAX_CHILDREN:
        raise Rejected("too many parts", f"{len(children)} below {part.label!r}, at most {MAX_CHILDREN} are looked at")
    whole = layout_parts(children, part.box.size)
    layout, symmetries = (
        (whole, [None] * len(children))
        if groups == "none"
        else form_groups(whole, order, strict=groups == "alike", pool=pool)
    )
    if len(layout.parts) > MAX_CUBOIDS:
        raise Rejected("too many parts", f"{len(layout.parts)} below {part.label!r}, at most {MAX_CUBOIDS} are wanted")
    joints = ground_parts(layout, tilted_placer(layout))
    if joints is None:
        raise Rejected("parts not connected", f"below {part.label!r}")
    indices = range(len(layout.parts))
    macros = [_macro(index, symmetry) for index, symmetry in enumerate(symmetries) if symmetry is not None]
    lines = (*(declaration_of(layout, index) for index in indices), *joints, *macros)
    x, y, z = np.maximum(part.box.size, MIN_CUBOID_SIZE).tolist()
    block = Block("", Cuboid(BBOX, (x, y, z), True), lines)
    return _Node(block, {part_name(i): layout.parts[i] for i in indices if layout.parts[i].children})


def _macro(part: int, symmetry: SymmetryMacro) -> Line:
    if symmetry.distance is None:
        return Reflect(part_name(part), AXES[symmetry.axis])
    return Translate(part_name(part), AXES[symmetry.axis], symmetry.copies, symmetry.distance)


def _renamed(line: Line, names: dict[str, str]) -> Line:
    def name(old: str) -> str:
        return names.get(old, old)

    if isinstance(line, Cuboid):
        return replace(line, name=name(line.name))
    if isinstance(line, Attach):
        return replace(line, moved=name(line.moved), target=name(line.target))
    if isinstance(line, Squeeze):
        return replace(line, moved=name(line.moved), first=name(line.first), second=name(line.second))
    return replace(line, moved=name(line.moved))
