"""Rewrite programs of the same shapes without a part of the language (shapeassembly §7.1, ablations of Table 2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.attachment_points import box_point, squeeze_attachments, upright_row
from stages.shapeassembly.execution.interpreter import execute_block
from stages.shapeassembly.execution.tables import next_copy_name
from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Point,
    Reflect,
    Squeeze,
    Translate,
)


def without_alignment(program: AssemblyProgram) -> AssemblyProgram:
    """Return the program with no aligned cuboid but the bounding boxes; some then turn."""
    return program.with_lines(
        lambda line: replace(line, aligned=False) if isinstance(line, Cuboid) and line.name != BBOX else line
    )


def without_order(program: AssemblyProgram, rng: np.random.Generator) -> AssemblyProgram:
    """Return the program with cuboids, attachments and macros each in random order.

    Attachments stay grounded, and those of one cuboid keep their order.
    """
    return AssemblyProgram(tuple(_shuffled(block, rng) for block in program.blocks))


def _shuffled(block: Block, rng: np.random.Generator) -> Block:
    cuboids = [block.cuboids[index] for index in rng.permutation(len(block.cuboids)).tolist()]
    joints = [line for line in block.lines if isinstance(line, Attach | Squeeze)]
    macros = [line for line in block.lines if isinstance(line, Reflect | Translate)]
    copied = {macro.moved for macro in macros} - {cuboid.name for cuboid in block.cuboids}
    if not copied:
        macros = [macros[index] for index in rng.permutation(len(macros)).tolist()]
    grounded, shuffled = {BBOX}, list[Line]()
    while joints:
        first_of = {joint.moved: joint for joint in reversed(joints)}
        ready = [joint for joint in joints if first_of[joint.moved] is joint and _targets(joint) <= grounded]
        # Lines that are not grounded in the original keep their order.
        joint = ready[int(rng.integers(len(ready)))] if ready else joints[0]
        joints.remove(joint)
        grounded.add(joint.moved)
        shuffled.append(joint)
    return replace(block, lines=(*cuboids, *shuffled, *macros))


def _targets(line: Attach | Squeeze) -> set[str]:
    return {line.target} if isinstance(line, Attach) else {line.first, line.second}


def without_macros(program: AssemblyProgram) -> AssemblyProgram:
    """Return the program with cuboids and attachments only.

    Each copy is declared and attached as the macro would, with a sub-program of its own, mirrored where it is a mirror
    image. Raises ProgramError where the program cannot be executed.
    """
    queue = [_expanded(program.root, program)]
    blocks: list[Block] = []
    while len(blocks) < len(queue):
        tree = queue[len(blocks)]
        names = {}
        for name, below in tree.below.items():
            names[name] = f"Program_{len(queue)}"
            queue.append(below)
        lines: tuple[Cuboid | Attach, ...] = (*tree.cuboids, *tree.joints)
        blocks.append(Block(f"Program_{len(blocks)}", tree.bbox, tuple(_renamed(line, names) for line in lines)))
    return AssemblyProgram(tuple(blocks))


@dataclass(frozen=True)
class _Tree:
    """An assembly of cuboids and attachments, and the assemblies that expand its cuboids, by name."""

    bbox: Cuboid
    cuboids: tuple[Cuboid, ...]
    joints: tuple[Attach, ...]
    below: dict[str, _Tree]

    def mirrored(self, axis: int) -> _Tree:
        """Return the mirror image across the middle of the bounding box."""
        joints = tuple(
            replace(item, source=_flipped(item.source, axis), goal=_flipped(item.goal, axis)) for item in self.joints
        )
        return replace(self, joints=joints, below={name: item.mirrored(axis) for name, item in self.below.items()})


def _expanded(block: Block, program: AssemblyProgram) -> _Tree:
    cuboids = {joint.name: joint for joint in block.cuboids}
    below = {name: _expanded(program.named[name], program) for name in cuboids if name in program.named}
    joints: list[Attach] = []
    names = [BBOX, *cuboids]
    for number, line in enumerate(block.lines):
        if isinstance(line, Attach):
            joints.append(line)
        elif isinstance(line, Squeeze):
            joints += squeeze_attachments(line)
        elif isinstance(line, Reflect | Translate):
            executed = execute_block(replace(block, lines=block.lines[:number]))
            boxes = {BBOX: upright_row(block.bbox), **dict(zip(*executed, strict=True))}
            for copy in range(1, 1 + (line.copies if isinstance(line, Translate) else 1)):
                name = next_copy_name(dict.fromkeys(names, 0))
                names.append(name)
                x, y, z = boxes[line.moved][3:6].tolist()
                cuboids[name] = Cuboid(name, (x, y, z), cuboids[line.moved].aligned)
                own = [joint for joint in joints if joint.moved == line.moved]
                joints += [_copied(joint, line, copy, name, boxes) for joint in own]
                if line.moved in below:
                    original = below[line.moved]
                    mirror = isinstance(line, Reflect)
                    below[name] = original.mirrored(AXES.index(line.axis)) if mirror else original
    return _Tree(block.bbox, tuple(cuboids.values()), tuple(joints), below)


def _copied(joint: Attach, line: Reflect | Translate, copy: int, name: str, boxes: dict[str, FloatArray]) -> Attach:
    """Return an attachment of a copy: the actual point of the original, mirrored or shifted."""
    axis = AXES.index(line.axis)
    moved, target = boxes[joint.moved], boxes[joint.target]
    point = box_point(moved, joint.source)
    if isinstance(line, Reflect):
        point[axis] = -point[axis]
    else:
        point[axis] += line.distance * copy / line.copies * boxes[BBOX][3 + axis]
    x, y, z = np.clip(target[6:].reshape(3, 3) @ (point - target[:3]) / target[3:6] + 0.5, 0, 1).tolist()
    source = _flipped(joint.source, axis) if isinstance(line, Reflect) else joint.source
    return Attach(name, joint.target, source, (x, y, z))


def _flipped(point: Point, axis: int) -> Point:
    x, y, z = (1 - coordinate if index == axis else coordinate for index, coordinate in enumerate(point))
    return (x, y, z)


def _renamed(line: Cuboid | Attach, names: dict[str, str]) -> Line:
    if isinstance(line, Cuboid):
        return replace(line, name=names.get(line.name, line.name))
    return replace(line, moved=names.get(line.moved, line.moved), target=names.get(line.target, line.target))
