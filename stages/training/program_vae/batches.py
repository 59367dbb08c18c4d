"""Programs as arrays of lines: the samples of a category, and the batches of a step, grouped by depth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches, padded_rows
from stages.training.corpus import ArrayCorpus
from stages.training.program_vae.lines import COMMAND, CUBOID, DIMS, LINE_WIDTH, SLOT_COUNT, START, AssemblyLines


@dataclass(frozen=True)
class ProgramCorpus(ArrayCorpus):
    """The programs of one category and split; assemblies breadth first.

    lines: float32 (lines, 63), those of each assembly end with STOP.
    children: int32 (lines,), the assembly, counted within its program, that expands the line's cuboid, or -1.
    node_first: int64 (nodes + 1,), where the lines of each assembly begin.
    boxes: float32 (nodes, 3).
    parents: int32 (nodes, 2), assembly within the program, and line, that each assembly expands.
    program_first: int64 (programs + 1,), where the assemblies of each program begin.
    """

    lines: npt.NDArray[np.float32]
    children: npt.NDArray[np.int32]
    node_first: npt.NDArray[np.int64]
    boxes: npt.NDArray[np.float32]
    parents: npt.NDArray[np.int32]
    program_first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, programs: Sequence[Sequence[AssemblyLines]]) -> ProgramCorpus:
        """Join at least one program."""
        nodes = [node for program in programs for node in program]
        return cls(
            lines=np.concatenate([node.numbers for node in nodes]).astype(np.float32),
            children=np.concatenate([node.children for node in nodes]).astype(np.int32),
            node_first=np.cumsum([0, *(len(node.numbers) for node in nodes)]),
            boxes=np.array([node.box for node in nodes], np.float32),
            parents=np.array([(node.parent, node.line) for node in nodes], np.int32),
            program_first=np.cumsum([0, *(len(program) for program in programs)]),
        )

    def __len__(self) -> int:
        return len(self.program_first) - 1

    @property
    def lengths(self) -> npt.NDArray[np.int64]:
        """Lines of each program with their STOPs, int64 (programs,)."""
        return np.diff(self.node_first[self.program_first])


@dataclass(frozen=True)
class AssemblyLevel:
    """The n assemblies of one depth of all programs of a batch.

    Index tensors are computed with the batch, so that no step waits for counts of the device.

    lines: float (n, longest, 63), 0 at padding.
    lengths: int64 (n,), lines with STOP.
    boxes: float (n, 3).
    sizes: float (n, 11, 3), of the bounding box and the declared cuboids.
    parents: int64 (n, 2), row in the level above and line that each assembly expands; -1 as the line of a root.
    places: int64 (k,), index of each line in rows x lines, sorted by command.
    expanded: bool (cuboids,), which of the declared cuboids are expanded.
    opened: int64 (m,), index of these among the declared cuboids.
    counts: number of lines of each command.
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

    def __len__(self) -> int:
        return len(self.lines)

    def to(self, device: torch.device) -> AssemblyLevel:
        moved = {name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items() if name != "counts"}
        return AssemblyLevel(**moved, counts=self.counts)

    @property
    def before(self) -> Tensor:
        """The line before each line, START before the first; float (n, longest, 63)."""
        first = torch.zeros_like(self.lines[:, :1])
        first[:, :, START] = 1
        return torch.cat([first, self.lines[:, :-1]], dim=1)


def batches(programs: ProgramCorpus, size: int, rng: np.random.Generator | None) -> Iterator[list[AssemblyLevel]]:
    """Yield all programs once, in batches as `bucket_batches`."""
    for numbers in bucket_batches(programs.lengths, size, rng):
        yield batch_of(programs, numbers)


def batch_of(programs: ProgramCorpus, numbers: npt.NDArray[np.int64]) -> list[AssemblyLevel]:
    """Build the levels of some programs, int64 (n,), roots first."""
    nodes = programs.program_first[numbers]
    parents = np.stack([np.arange(len(numbers)), np.full(len(numbers), -1)], axis=1)
    first = nodes.copy()
    levels = []
    while len(nodes):
        level, expanded = _level(programs, nodes, parents)
        levels.append(level)
        row, line = np.nonzero(expanded)
        below = programs.children[programs.node_first[nodes[row]] + line]
        nodes, first = first[row] + below, first[row]
        parents = np.stack([row, line], axis=1)
    return levels


def _level(
    programs: ProgramCorpus, nodes: npt.NDArray[np.int64], parents: npt.NDArray[np.int64]
) -> tuple[AssemblyLevel, npt.NDArray[np.bool_]]:
    filled, source = padded_rows(programs.node_first, nodes)
    lines = np.where(filled[..., None], programs.lines[source], np.float32(0))
    expanded = filled & (programs.children[source] >= 0)
    sizes = np.zeros((len(nodes), SLOT_COUNT, 3), np.float32)
    sizes[:, 0] = programs.boxes[nodes]
    row, line = np.nonzero(lines[..., CUBOID])
    slot = np.cumsum(lines[..., CUBOID], axis=1)[row, line].astype(np.int64)
    sizes[row, slot] = lines[row, line, DIMS]
    flat = np.flatnonzero(filled)
    kinds = lines.reshape(-1, LINE_WIDTH)[flat, COMMAND].argmax(axis=1)
    opens = expanded[row, line]
    return AssemblyLevel(
        lines=torch.from_numpy(lines),
        lengths=torch.from_numpy(np.diff(programs.node_first)[nodes]),
        boxes=torch.from_numpy(programs.boxes[nodes]),
        sizes=torch.from_numpy(sizes),
        parents=torch.from_numpy(parents),
        places=torch.from_numpy(flat[np.argsort(kinds, kind="stable")]),
        expanded=torch.from_numpy(opens),
        opened=torch.from_numpy(np.flatnonzero(opens)),
        counts=tuple(np.bincount(kinds, minlength=7).tolist()),
    ), expanded
