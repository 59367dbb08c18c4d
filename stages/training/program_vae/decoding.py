"""Writes programs from points of the latent space: the assemblies of a level line by line, together (shapeassembly
§6.1, App. D)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
import torch
from torch import Tensor

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.program import AXES, FACES, AssemblyProgram, Attach, Reflect, Squeeze, Translate
from stages.training.latent import LatentPoints
from stages.training.program_vae.lines import (
    ALIGNED,
    ATTACH,
    AXIS,
    COPIES,
    COPIES_UNIT,
    CUBOID,
    DIMS,
    FACE,
    INDICES,
    LINE_WIDTH,
    POINTS,
    SLOT_COUNT,
    SQUEEZE,
    START,
    STOP,
    UV,
)
from stages.training.program_vae.model import ProgramVae
from stages.training.program_vae.partial_assembly import MAX_DEPTH, LineChoice, LineNumbers, PartialAssembly
from stages.training.program_vae.reaching import add_line

LINE_TRIES = 4
"""Lines of each command that are tried where one breaks a rule."""


@dataclass
class _Node:
    """An assembly that is being written. shape: the number of its program; waiting: the cuboids that are to be
    expanded, with their codes; failed: whether a line broke a rule and no other could be found."""

    draft: PartialAssembly
    code: Tensor
    shape: int
    waiting: list[tuple[int, Tensor]] = field(default_factory=list)
    failed: bool = False
    last: Tensor = field(default_factory=lambda: _one_hot(START))


@torch.no_grad()
def decode_programs(module: ProgramVae, points: LatentPoints, *, reject: bool) -> list[AssemblyProgram | None]:
    """A program for each point, float32 (n, latent), its numbers to three decimals.

    None where a line broke a rule and no other could be found, and for a program that is beyond the limits of
    execution; without `reject` an assembly ends before such a line, as for interpolation. None is a program without a
    cuboid, too.
    """
    device = next(module.parameters()).device
    codes = torch.from_numpy(points).to(device)
    boxes = np.round(np.maximum(module.root_box(codes).cpu().numpy().astype(float), 2 * MIN_CUBOID_SIZE), 3)
    level = [
        _Node(PartialAssembly((float(x), float(y), float(z))), codes[shape], shape)
        for shape, (x, y, z) in enumerate(boxes)
    ]
    roots = [node.draft for node in level]
    failed: set[int] = set()
    for depth in range(MAX_DEPTH):
        if not level:
            break
        _write_level(module, level)
        failed |= {node.shape for node in level if node.failed}
        below: list[_Node] = []
        for node in level:
            for slot, code in node.waiting if depth + 1 < MAX_DEPTH and node.shape not in failed else ():
                if slot in node.draft.grounded:
                    draft = PartialAssembly(node.draft.sizes[slot - 1])
                    node.draft.below[slot - 1] = draft
                    below.append(_Node(draft, code, node.shape))
        level = below
    return [
        None if (reject and shape in failed) or not root.grounded else root.program()
        for shape, root in enumerate(roots)
    ]


def _write_level(module: ProgramVae, level: Sequence[_Node]) -> None:
    """Writes the assemblies of a level to their ends."""
    states = module.start(torch.stack([node.code for node in level]))
    open_ = list(range(len(level)))
    while open_:
        nodes = [level[each] for each in open_]
        shown = torch.stack([node.last for node in nodes]).to(states.device)[:, None]
        written, states = module.write(shown, states)
        ended = _write_lines(module, nodes, written[:, 0])
        going = [place for place, over in enumerate(ended) if not over]
        open_ = [open_[place] for place in going]
        states = states[:, going]


def _write_lines(module: ProgramVae, nodes: Sequence[_Node], states: Tensor) -> list[bool]:
    """One line more of each assembly; whether each has ended."""
    boxes = states.new_tensor([node.draft.box for node in nodes])
    heads = module.lines
    logits = heads.command(states, boxes).cpu().numpy()
    commands = torch.eye(7, device=states.device).repeat(len(nodes), 1)
    every = heads.indices(states.repeat_interleave(7, dim=0), commands).view(len(nodes), 7, 3, SLOT_COUNT).cpu().numpy()
    sizes, aligned = (each.cpu().numpy() for each in heads.cuboid(states, boxes))
    tries = [_tries(node.draft.choices(logits[row], every[row], LINE_TRIES)) for row, node in enumerate(nodes)]
    ended = [False] * len(nodes)
    pending = list(range(len(nodes)))
    tried = 0
    while pending:
        rows = [row for row in pending if tried < len(tries[row])]
        for row in set(pending) - set(rows):
            # Nothing that may follow keeps the rules.
            nodes[row].failed = True
            ended[row] = True
        chosen = [tries[row][tried][0] for row in rows]
        named = [place for place, choice in enumerate(chosen) if choice[0] not in (STOP, CUBOID)]
        at = [rows[place] for place in named]
        numbers = _numbers(module, [nodes[row] for row in at], states[at], [chosen[place] for place in named])
        of_place = dict(zip(named, numbers, strict=True))
        pending = []
        for place, row in enumerate(rows):
            node, choice = nodes[row], chosen[place]
            if choice[0] == STOP:
                ended[row] = True
            elif choice[0] == CUBOID:
                _declare(module, node, states[row], sizes[row], bool(aligned[row] > 0))
            elif add_line(node.draft, choice, of_place[place], reaching=tries[row][tried][1]):
                node.last = _line_of(node.draft, choice)
            else:
                pending.append(row)
        tried += 1
    return ended


def _tries(choices: Sequence[LineChoice]) -> list[tuple[LineChoice, bool]]:
    """The lines in the order in which they are tried, and whether a cuboid must reach where one attaches it: first with
    this, then without, before another command is."""
    found: list[tuple[LineChoice, bool]] = []
    for command, alike in groupby(choices, key=lambda choice: choice[0]):
        lines = list(alike)
        found += [(each, True) for each in lines] if command in (ATTACH, SQUEEZE) else []
        found += [(each, False) for each in lines]
    return found


def _declare(module: ProgramVae, node: _Node, state: Tensor, sizes: FloatArray, aligned: bool) -> None:
    draft = node.draft
    draft.declare(sizes, aligned, None)
    made = state.new_tensor(draft.sizes[-1])[None]
    flag, code = module.lines.child(state[None], made, node.code[None])
    if float(flag[0]) > 0:
        node.waiting.append((len(draft.sizes), code[0]))
    node.last = _one_hot(CUBOID)
    node.last[DIMS] = made[0].cpu()
    node.last[ALIGNED] = float(aligned)


def _numbers(
    module: ProgramVae, nodes: Sequence[_Node], states: Tensor, choices: Sequence[LineChoice]
) -> list[LineNumbers]:
    """What the line decoder says of lines with these commands and slots."""
    if not nodes:
        return []
    slots = torch.zeros(len(nodes), 3, SLOT_COUNT)
    sizes = torch.zeros(len(nodes), SLOT_COUNT, 3)
    for row, (node, (_, *named)) in enumerate(zip(nodes, choices, strict=True)):
        for place, slot in enumerate(named):
            slots[row, place, slot] = 1
        declared = torch.tensor([node.draft.box, *node.draft.sizes])
        sizes[row, : len(declared)] = declared
    slots, sizes = slots.to(states), sizes.to(states)
    three = slots @ sizes
    heads = module.lines
    points = heads.attach(states, slots[:, :2], three[:, :2])
    faces, uv = heads.squeeze(states, slots, three)
    axes, copies = heads.symmetry(states, slots[:, 0], three[:, 0], sizes[:, 0])
    return [
        LineNumbers(
            points=points[row].cpu().numpy(),
            face=int(faces[row].argmax()),
            uv=uv[row].cpu().numpy(),
            axis=int(axes[row].argmax()),
            copies=round(float(copies[row, 0]) * COPIES_UNIT),
            distance=float(copies[row, 1]),
        )
        for row in range(len(nodes))
    ]


def _line_of(draft: PartialAssembly, choice: LineChoice) -> Tensor:
    """The line that was written last, as the decoder sees it."""
    command, *named = choice
    row = _one_hot(command)
    for place, slot in enumerate(named):
        row[INDICES.start + SLOT_COUNT * place + slot] = 1
    line = draft.lines[-1]
    if isinstance(line, Attach):
        row[POINTS] = torch.tensor([*line.source, *line.goal])
    elif isinstance(line, Squeeze):
        row[FACE.start + FACES.index(line.face)] = 1
        row[UV] = torch.tensor([line.u, line.v])
    elif isinstance(line, Reflect):
        row[AXIS.start + AXES.index(line.axis)] = 1
    elif isinstance(line, Translate):
        row[AXIS.start + AXES.index(line.axis)] = 1
        row[COPIES] = torch.tensor([line.copies / COPIES_UNIT, line.distance])
    return row


def _one_hot(command: int) -> Tensor:
    row = torch.zeros(LINE_WIDTH)
    row[command] = 1
    return row
