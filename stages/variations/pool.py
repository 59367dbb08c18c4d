"""The pool of variants on disk: what a shard of the search found, as flat arrays that are mapped, not loaded.

Files of a shard: `types.npy` int16 (N,), `poses.npy` float64 (N, 4, 4), `edges.npy` int32 (M, 2), `labels.npy`
int32 (M, 2), `offsets.npy` int64 (k + 1, 2) into the former for k variants, `keys.npy` uint64 (k, 2) of refinement,
`digests.npy` uint8 (k, 2, 32) of the canonical graph without and with docking labels, `lineage.jsonl`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Task
from stages.shape.arrays import IntArray
from stages.shape.canonical import docking_digest, graph_digest
from stages.shape.kit import Assembly
from stages.variations.search import Variant

__all__ = ["FoundVariants", "write_variants"]


def write_variants(task: Task, variants: Sequence[Variant]) -> None:
    """Write what a shard of the search has found."""
    name = task.shard.name
    assemblies = [each.assembly for each in variants]
    sizes = np.array([(len(each), len(each.edges)) for each in assemblies], dtype=np.int64).reshape(-1, 2)
    digests = [
        (
            graph_digest(each.assembly.types, each.assembly.edges),
            docking_digest(each.assembly.types, each.assembly.edges, each.labels),
        )
        for each in variants
    ]
    arrays = {
        "types": np.concatenate([np.empty(0, np.int16), *(each.types for each in assemblies)]),
        "poses": np.concatenate([np.empty((0, 4, 4)), *(each.poses for each in assemblies)]),
        "edges": np.concatenate([np.empty((0, 2), np.int32), *(each.edges for each in assemblies)]),
        "labels": np.concatenate([np.empty((0, 2), np.int32), *(each.labels for each in variants)]),
        "offsets": np.concatenate([np.zeros((1, 2), np.int64), sizes.cumsum(axis=0)]),
        "keys": np.array([(each.graph, each.docked) for each in variants], dtype=np.uint64).reshape(-1, 2),
        "digests": np.frombuffer(bytes.fromhex("".join(a + b for a, b in digests)), dtype=np.uint8).reshape(-1, 2, 32),
    }
    for member, array in arrays.items():
        with task.output(f"{name}.{member}.npy") as stream:
            stream.write(array_bytes(array))
    with task.output(f"{name}.lineage.jsonl") as stream:
        for each in variants:
            stream.write(json_bytes(each.lineage))


@dataclass(frozen=True)
class FoundVariants:
    """The variants of one shard, read from disk as they are asked for."""

    name: str
    types: np.ndarray
    poses: np.ndarray
    edges: np.ndarray
    labels: np.ndarray
    offsets: np.ndarray
    keys: np.ndarray
    digests: np.ndarray
    lineage: tuple[bytes, ...]

    @classmethod
    def of(cls, task: Task, shard: str) -> FoundVariants:
        """What `shard`, one of the inputs, found."""
        arrays = {
            member: _mapped(task.input("variations", f"{shard}.{member}.npy"))
            for member in ("types", "poses", "edges", "labels", "offsets", "keys", "digests")
        }
        lineage = tuple(task.input("variations", f"{shard}.lineage.jsonl").read_bytes().splitlines())
        return cls(shard, lineage=lineage, **arrays)

    def __len__(self) -> int:
        return len(self.keys)

    def assembly(self, index: int) -> tuple[Assembly, IntArray]:
        """One variant and the docking labels of its edges."""
        (part, edge), (last_part, last_edge) = self.offsets[index].tolist(), self.offsets[index + 1].tolist()
        assembly = Assembly(
            np.array(self.types[part:last_part]),
            np.array(self.poses[part:last_part]),
            np.array(self.edges[edge:last_edge]),
        )
        return assembly, np.array(self.labels[edge:last_edge])

    def types_of(self, index: int) -> np.ndarray:
        """The part types of one variant, int16 (n,)."""
        types: np.ndarray = self.types[self.offsets[index, 0] : self.offsets[index + 1, 0]]
        return types

    def histogram(self, index: int, types: int) -> bytes:
        """The number of parts of each of `types` types of one variant, as bytes."""
        return np.bincount(self.types_of(index), minlength=types).astype(np.int32).tobytes()

    def described(self, index: int) -> dict[str, Any]:
        """The lineage of one variant."""
        lineage: dict[str, Any] = json.loads(self.lineage[index])
        return lineage

    def digest(self, index: int, docked: bool) -> bytes:
        """The digest of one variant's canonical graph, with docking labels if `docked`."""
        return bytes(self.digests[index, int(docked)])


def _mapped(path: Path) -> np.ndarray:
    """An array on disk, mapped; an empty one, which cannot be mapped, is loaded."""
    empty = len(np.load(path, mmap_mode=None, allow_pickle=False)) == 0 if path.stat().st_size < 4096 else False
    return np.load(path, mmap_mode=None if empty else "r", allow_pickle=False)
