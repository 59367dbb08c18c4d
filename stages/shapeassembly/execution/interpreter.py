"""Execute programs, one at a time or many at once (shapeassembly §4, App. A and B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.tables import IndexArray, ProgramTables, program_tables
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.limits import MAX_BLOCK_ATTACHMENTS, MAX_DEPTH, MAX_PARTS, MAX_REACH
from stages.shapeassembly.syntax.program import AssemblyProgram, Block

if TYPE_CHECKING:
    from stages.shapeassembly.execution.kernels import ExecutedTables

_REFUSALS = {
    1: ("too many cuboids", f"expanded it has more than {MAX_PARTS}"),
    2: ("too deep", f"assemblies are nested more than {MAX_DEPTH} deep, or in a circle"),
    3: ("too many attachments", f"an assembly has at most {MAX_BLOCK_ATTACHMENTS}, those of copies included"),
    4: ("too far", f"a cuboid reaches beyond {MAX_REACH:g}"),
}


@dataclass(frozen=True)
class Execution:
    """The leaf cuboids of an executed program, by assembly breadth first, each in the order of its lines.

    corners: float64 (n, 8, 3), the local points (1, 1, 1), (1, 1, 0), (1, 0, 1), ... (0, 0, 0) of each cuboid.
    centres, sizes: float64 (n, 3).
    frames: float64 (n, 3, 3), rotations whose columns are the cuboids' axes.
    nodes: int64 (n,), the assembly of each cuboid, counted breadth first.
    """

    corners: FloatArray
    centres: FloatArray
    sizes: FloatArray
    frames: FloatArray
    nodes: IndexArray
    _parts: IndexArray
    _tree: IndexArray
    _root: str
    _names: tuple[tuple[str, ...], ...]
    _originals: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        return len(self.corners)

    @cached_property
    def node_names(self) -> tuple[str, ...]:
        """The assemblies by path, the root first: `Program_0`, `Program_0/Program_1`, `Program_0/cube3` (a copy)."""
        return self._node_paths(self._names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The leaves by path, which is unique: `Program_0/Program_1/cube0`."""
        return self._leaf_paths(self._names)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The path of each leaf, where a copy has the name of its original: `Armchair/arm`."""
        return self._leaf_paths(self._originals)

    def _node_paths(self, names: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
        paths = [self._root]
        for _, parent, part in self._tree[1:].tolist():
            paths.append(f"{paths[parent]}/{names[self._tree[parent, 0]][part]}")
        return tuple(paths)

    def _leaf_paths(self, names: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
        nodes, blocks = self._node_paths(names), self._tree[:, 0].tolist()
        return tuple(
            f"{nodes[node]}/{names[blocks[node]][part]}"
            for node, part in zip(self.nodes.tolist(), self._parts.tolist(), strict=True)
        )


def execute(program: AssemblyProgram) -> Execution:
    """Execute one program. Raises ProgramError where it cannot be executed or exceeds the limits."""
    return execute_tables(program_tables([program]), [program])[0]


def execute_all(programs: Sequence[AssemblyProgram]) -> list[Execution]:
    """Execute many programs, faster than one by one. Raises ProgramError as `execute`."""
    return execute_tables(program_tables(programs), programs)


def execute_tables(flat: ProgramTables, programs: Sequence[AssemblyProgram]) -> list[Execution]:
    """Execute the programs of some tables."""
    from stages.shapeassembly.execution.kernels import run_tables

    executed: ExecutedTables
    executed, _, _ = run_tables(flat.rows, flat.block_rows, flat.block_parts, flat.program_blocks)
    check_executed(executed)
    executions = []
    leaf_starts, node_starts, blocks = (
        starts.tolist() for starts in (executed.program_leaves, executed.program_nodes, flat.program_blocks)
    )
    centres, sizes = executed.leaves[:, :3], executed.leaves[:, 3:6]
    frames = executed.leaves[:, 6:].reshape(-1, 3, 3).transpose(0, 2, 1)
    for index, program in enumerate(programs):
        low, high = leaf_starts[index], leaf_starts[index + 1]
        executions.append(
            Execution(
                executed.corners[low:high],
                centres[low:high],
                sizes[low:high],
                frames[low:high],
                executed.leaf_node[low:high],
                executed.leaf_part[low:high],
                executed.node[node_starts[index] : node_starts[index + 1]],
                program.root.name,
                flat.names[blocks[index] : blocks[index + 1]],
                flat.originals[blocks[index] : blocks[index + 1]],
            )
        )
    return executions


def execute_block(block: Block) -> tuple[tuple[str, ...], FloatArray]:
    """Execute one assembly by itself, whatever expands its cuboids.

    Returns the names of its cuboids and copies without the bounding box, and their centre, sizes and axes in its
    coordinates, float64 (n, 15). Raises ProgramError as `execute`.
    """
    from stages.shapeassembly.execution.kernels import run_tables

    flat = program_tables([AssemblyProgram((block,))])
    executed: ExecutedTables
    executed, _, _ = run_tables(flat.rows, flat.block_rows, flat.block_parts, flat.program_blocks)
    check_executed(executed)
    return flat.names[0][1:], executed.boxes[1:]


def check_executed(executed: ExecutedTables) -> None:
    """Raise ProgramError if a program was not executed."""
    if executed.status.any():
        index = int(executed.status.nonzero()[0][0])
        reason, detail = _REFUSALS[int(executed.status[index])]
        raise ProgramError(reason, f"program {index + 1} of {len(executed.status)}: {detail}" if index else detail)
