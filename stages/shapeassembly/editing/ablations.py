"""Programs of the same shapes in other words, for models that learn without a part of the language (shapeassembly §7.1,
the ablations of Table 2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.attachment_points import squeeze_attachments
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
    """The program in which no cuboid but the bounding boxes is aligned: some turn that did not."""
    return program.with_lines(
        lambda line: replace(line, aligned=False) if isinstance(line, Cuboid) and line.name != BBOX else line
    )


def without_order(program: AssemblyProgram, rng: np.random.Generator) -> AssemblyProgram:
    """The program with its cuboids, its attachments and its macros each in random order: attachments still grounded,
    those that move one cuboid still one after another."""
    return AssemblyProgram(tuple(_unordered(block, rng) for block in program.blocks))


def _unordered(block: Block, rng: np.random.Generator) -> Block:
    cuboids = [block.cuboids[place] for place in rng.permutation(len(block.cuboids)).tolist()]
    joints = [line for line in block.lines if isinstance(line, Attach | Squeeze)]
    macros = [line for line in block.lines if isinstance(line, Reflect | Translate)]
    copied = {each.moved for each in macros} - {each.name for each in block.cuboids}
    if not copied:
        macros = [macros[place] for place in rng.permutation(len(macros)).tolist()]
    grounded, chosen = {BBOX}, list[Line]()
    while joints:
        firsts = {each.moved: each for each in reversed(joints)}
        ready = [each for each in joints if firsts[each.moved] is each and _targets(each) <= grounded]
        # What its authors have not grounded stays in its order.
        line = ready[int(rng.integers(len(ready)))] if ready else joints[0]
        joints.remove(line)
        grounded.add(line.moved)
        chosen.append(line)
    return replace(block, lines=(*cuboids, *chosen, *macros))


def _targets(line: Attach | Squeeze) -> set[str]:
    return {line.target} if isinstance(line, Attach) else {line.first, line.second}


def without_macros(program: AssemblyProgram) -> AssemblyProgram:
    """The program with cuboids and attachments alone: each copy is declared and attached as the macro would, and has a
    sub-program of its own, mirrored where it is a mirror image.

    Raises ProgramError where the program cannot be executed.
    """
    ahead = [_expanded(program.root, program)]
    blocks: list[Block] = []
    while len(blocks) < len(ahead):
        tree = ahead[len(blocks)]
        called = {}
        for name, below in tree.below.items():
            called[name] = f"Program_{len(ahead)}"
            ahead.append(below)
        lines: tuple[Cuboid | Attach, ...] = (*tree.cuboids, *tree.joints)
        blocks.append(Block(f"Program_{len(blocks)}", tree.bbox, tuple(_renamed(line, called) for line in lines)))
    return AssemblyProgram(tuple(blocks))


@dataclass(frozen=True)
class _Tree:
    """An assembly of cuboids and attachments alone, and what expands its cuboids, by name."""

    bbox: Cuboid
    cuboids: tuple[Cuboid, ...]
    joints: tuple[Attach, ...]
    below: dict[str, _Tree]

    def mirrored(self, axis: int) -> _Tree:
        """The mirror image across the middle of the bounding box."""
        joints = tuple(
            replace(each, source=_flipped(each.source, axis), goal=_flipped(each.goal, axis)) for each in self.joints
        )
        return replace(self, joints=joints, below={name: each.mirrored(axis) for name, each in self.below.items()})


def _expanded(block: Block, program: AssemblyProgram) -> _Tree:
    cuboids = {each.name: each for each in block.cuboids}
    below = {name: _expanded(program.named[name], program) for name in cuboids if name in program.named}
    joints: list[Attach] = []
    places = [BBOX, *cuboids]
    for number, line in enumerate(block.lines):
        if isinstance(line, Attach):
            joints.append(line)
        elif isinstance(line, Squeeze):
            joints += squeeze_attachments(line)
        elif isinstance(line, Reflect | Translate):
            made = execute_block(replace(block, lines=block.lines[:number]))
            boxes = {BBOX: _upright(block.bbox), **dict(zip(*made, strict=True))}
            for copy in range(1, 1 + (line.copies if isinstance(line, Translate) else 1)):
                name = next_copy_name(dict.fromkeys(places, 0))
                places.append(name)
                x, y, z = boxes[line.moved][3:6].tolist()
                cuboids[name] = Cuboid(name, (x, y, z), cuboids[line.moved].aligned)
                own = [each for each in joints if each.moved == line.moved]
                joints += [_copied(each, line, copy, name, boxes) for each in own]
                if line.moved in below:
                    original = below[line.moved]
                    mirror = isinstance(line, Reflect)
                    below[name] = original.mirrored(AXES.index(line.axis)) if mirror else original
    return _Tree(block.bbox, tuple(cuboids.values()), tuple(joints), below)


def _copied(joint: Attach, line: Reflect | Translate, copy: int, name: str, boxes: dict[str, FloatArray]) -> Attach:
    """An attachment of a copy: where the original really is attached, mirrored or moved."""
    axis = AXES.index(line.axis)
    moved, target = boxes[joint.moved], boxes[joint.target]
    place = moved[:3] + ((np.array(joint.source) - 0.5) * moved[3:6]) @ moved[6:].reshape(3, 3)
    if isinstance(line, Reflect):
        place[axis] = -place[axis]
    else:
        place[axis] += line.distance * copy / line.copies * boxes[BBOX][3 + axis]
    x, y, z = np.clip(target[6:].reshape(3, 3) @ (place - target[:3]) / target[3:6] + 0.5, 0, 1).tolist()
    source = _flipped(joint.source, axis) if isinstance(line, Reflect) else joint.source
    return Attach(name, joint.target, source, (x, y, z))


def _upright(bbox: Cuboid) -> FloatArray:
    return np.array([0.0, 0.0, 0.0, *bbox.dims, *np.eye(3).ravel()])


def _flipped(point: Point, axis: int) -> Point:
    x, y, z = (1 - each if place == axis else each for place, each in enumerate(point))
    return (x, y, z)


def _renamed(line: Cuboid | Attach, called: dict[str, str]) -> Line:
    if isinstance(line, Cuboid):
        return replace(line, name=called.get(line.name, line.name))
    return replace(line, moved=called.get(line.moved, line.moved), target=called.get(line.target, line.target))
