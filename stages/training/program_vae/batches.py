"""The programs that a model learns from, by numbers, and the batches of a step: nodes of one level together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches
from stages.training.program_vae.lines import COMMAND, CUBOID, DIMS, LINE_WIDTH, SLOT_COUNT, START, AssemblyLines


@dataclass(frozen=True)
class ProgramCorpus:
    """Programs of one category and split, their assemblies behind each other, root first, breadth first.

    lines: float32 (lines, 63), each assembly's with STOP at its end; children: int32 (lines,), the number of the
    assembly, within its program, that expands the cuboid of a line, or -1; node_first: int64 (nodes + 1,), where each
    assembly's lines begin; boxes: float32 (nodes, 3); parents: int32 (nodes, 2), assembly, within the program, and line
    that each expands; program_first: int64 (programs + 1,), where each program's assemblies begin.
    """

    lines: npt.NDArray[np.float32]
    children: npt.NDArray[np.int32]
    node_first: npt.NDArray[np.int64]
    boxes: npt.NDArray[np.float32]
    parents: npt.NDArray[np.int32]
    program_first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, programs: Sequence[Sequence[AssemblyLines]]) -> ProgramCorpus:
        """At least one program."""
        nodes = [node for program in programs for node in program]
        return cls(
            lines=np.concatenate([node.numbers for node in nodes]).astype(np.float32),
            children=np.concatenate([node.children for node in nodes]).astype(np.int32),
            node_first=np.cumsum([0, *(len(node.numbers) for node in nodes)]),
            boxes=np.array([node.box for node in nodes], np.float32),
            parents=np.array([(node.parent, node.line) for node in nodes], np.int32),
            program_first=np.cumsum([0, *(len(program) for program in programs)]),
        )

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> ProgramCorpus:
        return cls(**{name: arrays[name] for name in cls.__dataclass_fields__})

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(vars(self))

    def __len__(self) -> int:
        return len(self.program_first) - 1

    @property
    def lengths(self) -> npt.NDArray[np.int64]:
        """Lines of each program, the ends among them, int64 (programs,)."""
        return np.diff(self.node_first[self.program_first])


@dataclass(frozen=True)
class AssemblyLevel:
    """The assemblies of one depth of all programs of a batch.

    lines: float (n, longest, 63), nothing behind an end; lengths: int64 (n,), with the end; boxes: float (n, 3);
    sizes: float (n, 11, 3), of the bounding box and the cuboids declared; parents: int64 (n, 2), the row in the level
    above and the line that each expands; of the root its own row.
    places: int64 (k,), where in rows x lines the lines stand, all of a command together and the commands in their
    order; counts: how many there are of each; expanded: bool (cuboids,), which of the lines that declare one are
    expanded, and opened: int64, which numbers they have among these. So no step has to wait for what the device counts.
    """

    lines: Tensor
    lengths: Tensor
    boxes: Tensor
    sizes: Tensor
    parents: Tensor
    places: Tensor
    expanded: Tensor
    opened: Tensor
    counts: tuple[int, ...]

    def to(self, device: torch.device) -> AssemblyLevel:
        moved = {name: each.to(device, non_blocking=True) for name, each in vars(self).items() if name != "counts"}
        return AssemblyLevel(**moved, counts=self.counts)

    @property
    def shown(self) -> Tensor:
        """What the decoder sees before each line: the one before it, at first START; float (n, longest, 63)."""
        first = torch.zeros_like(self.lines[:, :1])
        first[:, :, START] = 1
        return torch.cat([first, self.lines[:, :-1]], dim=1)


def batches(programs: ProgramCorpus, size: int, rng: np.random.Generator | None) -> Iterator[list[AssemblyLevel]]:
    """All programs once, in random order and in batches of programs of like length; with no `rng`, in their order."""
    for rows in bucket_batches(programs.lengths, size, rng):
        yield batch_of(programs, rows)


def batch_of(programs: ProgramCorpus, rows: npt.NDArray[np.int64]) -> list[AssemblyLevel]:
    """The levels of some programs, int64 (n,), the roots first."""
    level = programs.program_first[rows]
    parents = np.stack([np.arange(len(rows)), np.full(len(rows), -1)], axis=1)
    first = level.copy()
    levels = []
    while len(level):
        made, expanded = _level(programs, level, parents)
        levels.append(made)
        row, line = np.nonzero(expanded)
        below = programs.children[programs.node_first[level[row]] + line]
        level, first = first[row] + below, first[row]
        parents = np.stack([row, line], axis=1)
    return levels


def _level(
    programs: ProgramCorpus, nodes: npt.NDArray[np.int64], parents: npt.NDArray[np.int64]
) -> tuple[AssemblyLevel, npt.NDArray[np.bool_]]:
    lengths = programs.node_first[nodes + 1] - programs.node_first[nodes]
    place = np.arange(lengths.max())
    there = place < lengths[:, None]
    at = np.where(there, programs.node_first[nodes][:, None] + place, 0)
    lines = np.where(there[..., None], programs.lines[at], np.float32(0))
    expanded = there & (programs.children[at] >= 0)
    sizes = np.zeros((len(nodes), SLOT_COUNT, 3), np.float32)
    sizes[:, 0] = programs.boxes[nodes]
    row, line = np.nonzero(lines[..., CUBOID])
    slot = np.cumsum(lines[..., CUBOID], axis=1)[row, line].astype(np.int64)
    sizes[row, slot] = lines[row, line, DIMS]
    flat = np.flatnonzero(there)
    kinds = lines.reshape(-1, LINE_WIDTH)[flat, COMMAND].argmax(axis=1)
    opens = expanded[row, line]
    return AssemblyLevel(
        lines=torch.from_numpy(lines),
        lengths=torch.from_numpy(lengths),
        boxes=torch.from_numpy(programs.boxes[nodes]),
        sizes=torch.from_numpy(sizes),
        parents=torch.from_numpy(parents),
        places=torch.from_numpy(flat[np.argsort(kinds, kind="stable")]),
        expanded=torch.from_numpy(opens),
        opened=torch.from_numpy(np.flatnonzero(opens)),
        counts=tuple(np.bincount(kinds, minlength=7).tolist()),
    ), expanded
