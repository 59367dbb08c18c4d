"""Decode latent points to programs, all assemblies of a level line by line together (shapeassembly §6.1, App. D)."""

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
    """An assembly that is being decoded.

    shape: number of its program.
    waiting: slots of the cuboids to expand, with their codes.
    failed: whether every tried line broke a rule.
    last: float (63,), the line before the next.
    """

    draft: PartialAssembly
    code: Tensor
    shape: int
    waiting: list[tuple[int, Tensor]] = field(default_factory=list)
    failed: bool = False
    last: Tensor = field(default_factory=lambda: _one_hot(START))


@torch.no_grad()
def decode_programs(module: ProgramVae, points: LatentPoints, *, reject: bool) -> list[AssemblyProgram | None]:
    """Decode latent points, float32 (n, latent), to programs with numbers to three decimals.

    Returns None for a program without a cuboid, beyond the limits of execution, or, with `reject`, in which every line
    tried broke a rule. Without `reject` an assembly ends before such a line, as for interpolation.
    """
    device = next(module.parameters()).device
    codes = torch.from_numpy(points).to(device)
    boxes = np.round(np.maximum(module.root_box(codes).cpu().numpy().astype(float), 2 * MIN_CUBOID_SIZE), 3)
    nodes = [
        _Node(PartialAssembly((float(x), float(y), float(z))), codes[shape], shape)
        for shape, (x, y, z) in enumerate(boxes)
    ]
    roots = [node.draft for node in nodes]
    failed: set[int] = set()
    for depth in range(MAX_DEPTH):
        if not nodes:
            break
        _decode_level(module, nodes)
        failed |= {node.shape for node in nodes if node.failed}
        below: list[_Node] = []
        for node in nodes:
            for slot, code in node.waiting if depth + 1 < MAX_DEPTH and node.shape not in failed else ():
                if slot in node.draft.grounded:
                    draft = PartialAssembly(node.draft.sizes[slot - 1])
                    node.draft.below[slot - 1] = draft
                    below.append(_Node(draft, code, node.shape))
        nodes = below
    return [
        None if (reject and shape in failed) or not root.grounded else root.program()
        for shape, root in enumerate(roots)
    ]


def _decode_level(module: ProgramVae, level: Sequence[_Node]) -> None:
    """Decode the assemblies of a level to their ends."""
    states = module.start(torch.stack([node.code for node in level]))
    open_ = list(range(len(level)))
    while open_:
        nodes = [level[row] for row in open_]
        before = torch.stack([node.last for node in nodes]).to(states.device)[:, None]
        decoded, states = module.decode(before, states)
        ended = _decode_lines(module, nodes, decoded[:, 0])
        rows = [row for row, has_ended in enumerate(ended) if not has_ended]
        open_ = [open_[row] for row in rows]
        states = states[:, rows]


def _decode_lines(module: ProgramVae, nodes: Sequence[_Node], states: Tensor) -> list[bool]:
    """Decode one more line of each assembly. Returns whether each has ended."""
    boxes = states.new_tensor([node.draft.box for node in nodes])
    heads = module.lines
    logits = heads.command(states, boxes).cpu().numpy()
    commands = torch.eye(7, device=states.device).repeat(len(nodes), 1)
    indices = (
        heads.indices(states.repeat_interleave(7, dim=0), commands).view(len(nodes), 7, 3, SLOT_COUNT).cpu().numpy()
    )
    sizes, aligned = (tensor.cpu().numpy() for tensor in heads.cuboid(states, boxes))
    tries = [_tries(node.draft.choices(logits[row], indices[row], LINE_TRIES)) for row, node in enumerate(nodes)]
    ended = [False] * len(nodes)
    pending = list(range(len(nodes)))
    attempt = 0
    while pending:
        rows = [row for row in pending if attempt < len(tries[row])]
        for row in set(pending) - set(rows):
            # No line that may follow keeps the rules.
            nodes[row].failed = True
            ended[row] = True
        chosen = [tries[row][attempt][0] for row in rows]
        named = [index for index, choice in enumerate(chosen) if choice[0] not in (STOP, CUBOID)]
        attached_rows = [rows[index] for index in named]
        numbers = _numbers(
            module, [nodes[row] for row in attached_rows], states[attached_rows], [chosen[index] for index in named]
        )
        line_numbers = dict(zip(named, numbers, strict=True))
        pending = []
        for index, row in enumerate(rows):
            node, choice = nodes[row], chosen[index]
            if choice[0] == STOP:
                ended[row] = True
            elif choice[0] == CUBOID:
                _declare(module, node, states[row], sizes[row], bool(aligned[row] > 0))
            elif add_line(node.draft, choice, line_numbers[index], reaching=tries[row][attempt][1]):
                node.last = _line_of(node.draft, choice)
            else:
                pending.append(row)
        attempt += 1
    return ended


def _tries(choices: Sequence[LineChoice]) -> list[tuple[LineChoice, bool]]:
    """Return the lines in the order of trial, and whether the cuboid must reach its attachments.

    Each command is tried with this condition, then without it, before another command.
    """
    tries: list[tuple[LineChoice, bool]] = []
    for command, group in groupby(choices, key=lambda choice: choice[0]):
        lines = list(group)
        tries += [(line, True) for line in lines] if command in (ATTACH, SQUEEZE) else []
        tries += [(line, False) for line in lines]
    return tries


def _declare(module: ProgramVae, node: _Node, state: Tensor, sizes: FloatArray, aligned: bool) -> None:
    draft = node.draft
    draft.declare(sizes, aligned, None)
    size = state.new_tensor(draft.sizes[-1])[None]
    flag, code = module.lines.child(state[None], size, node.code[None])
    if float(flag[0]) > 0:
        node.waiting.append((len(draft.sizes), code[0]))
    node.last = _one_hot(CUBOID)
    node.last[DIMS] = size[0].cpu()
    node.last[ALIGNED] = float(aligned)


def _numbers(
    module: ProgramVae, nodes: Sequence[_Node], states: Tensor, choices: Sequence[LineChoice]
) -> list[LineNumbers]:
    """Return the predicted numbers of lines with some commands and slots."""
    if not nodes:
        return []
    slots = torch.zeros(len(nodes), 3, SLOT_COUNT)
    sizes = torch.zeros(len(nodes), SLOT_COUNT, 3)
    for row, (node, (_, *named)) in enumerate(zip(nodes, choices, strict=True)):
        for position, slot in enumerate(named):
            slots[row, position, slot] = 1
        declared = torch.tensor([node.draft.box, *node.draft.sizes])
        sizes[row, : len(declared)] = declared
    slots, sizes = slots.to(states), sizes.to(states)
    named_sizes = slots @ sizes
    heads = module.lines
    points = heads.attach(states, slots[:, :2], named_sizes[:, :2])
    faces, uv = heads.squeeze(states, slots, named_sizes)
    axes, copies = heads.symmetry(states, slots[:, 0], named_sizes[:, 0], sizes[:, 0])
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
    """Return the last line as input of the decoder."""
    command, *named = choice
    row = _one_hot(command)
    for position, slot in enumerate(named):
        row[INDICES.start + SLOT_COUNT * position + slot] = 1
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
