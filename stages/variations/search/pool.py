"""The pool of variants on disk: what search shards found, as memory-mapped arrays, and an index of what pools kept.

Files of a search shard with k variants, N parts and M edges:
types.npy: int16 (N,)
origins.npy: int8 (N,), the exemplar of each part
poses.npy: float64 (N, 4, 4)
stretched.npy: int64 (s,), the parts of variants with stretched ones; stretches.npy: float64 (s, 3, 3)
edges.npy: int32 (M, 2); labels.npy: int32 (M, 2)
offsets.npy: int64 (k + 1, 2), first part and first edge of each variant
features.npy: float32 (k, 10)
keys.npy: uint64 (k, 2), keys by colour refinement
digests.npy: uint8 (k, 2, 32), of the canonical graph without and with docking labels
numbers.npy: int64 (k,), ascending, the number of each among all that the search found: its name is `<search>-<number>`
lineage.jsonl: a line for each that the search found, kept or not, since any may be the parent of another

Files of a pool shard: kept.npy int64 (k, 2), search and index there of each variant that it kept, counts.npy int32 (k,
    types) of parts by type, and features.npy, keys.npy and digests.npy as above.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Task
from stages.shape.arrays import IntArray
from stages.shape.graphs.canonical import docking_digest, graph_digest
from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.features import AXES
from stages.variations.search.rounds import search_name
from stages.variations.search.variant import Variant

_INDEX = ("counts", "features", "keys", "digests")
_FOUND = ("types", "origins", "poses", "stretched", "stretches", "edges", "labels", "offsets", "numbers", *_INDEX[1:])


def write_variants(task: Task, kit: Kit, found: Sequence[Variant], kept: Sequence[Variant]) -> None:
    """Write the variants of a kit that a search shard keeps of those that it `found`, and the lineages of all."""
    name, variants = task.shard.name, kept
    lineages = [variant.lineage for variant in found]
    for variant in kept:
        lineages[variant.number] = variant.lineage
    assemblies = [variant.assembly for variant in variants]
    sizes = np.array([(len(shape), len(shape.edges)) for shape in assemblies], dtype=np.int64).reshape(-1, 2)
    digests = [
        (
            graph_digest(kit.label_of[variant.assembly.types], variant.assembly.edges),
            docking_digest(variant.assembly.types, variant.assembly.edges, variant.labels),
        )
        for variant in variants
    ]
    first = np.concatenate([np.zeros(1, np.int64), sizes[:, 0].cumsum()])
    stretched = [
        (start, shape.stretches) for start, shape in zip(first, assemblies, strict=False) if shape.stretches is not None
    ]
    arrays = {
        "numbers": np.array([variant.number for variant in variants], dtype=np.int64),
        "types": np.concatenate([np.empty(0, np.int16), *(shape.types for shape in assemblies)]),
        "origins": np.concatenate([np.empty(0, np.int8), *(variant.origins for variant in variants)]),
        "poses": np.concatenate([np.empty((0, 4, 4)), *(shape.poses for shape in assemblies)]),
        "stretched": np.concatenate(
            [np.empty(0, np.int64), *(start + np.arange(len(own)) for start, own in stretched)]
        ),
        "stretches": np.concatenate([np.empty((0, 3, 3)), *(own for _, own in stretched)]),
        "edges": np.concatenate([np.empty((0, 2), np.int32), *(shape.edges for shape in assemblies)]),
        "labels": np.concatenate([np.empty((0, 2), np.int32), *(variant.labels for variant in variants)]),
        "offsets": np.concatenate([np.zeros((1, 2), np.int64), sizes.cumsum(axis=0)]),
        "features": np.array([variant.features for variant in variants], dtype=np.float32).reshape(-1, len(AXES)),
        "keys": np.array([(variant.graph, variant.docked) for variant in variants], dtype=np.uint64).reshape(-1, 2),
        "digests": np.frombuffer(bytes.fromhex("".join(a + b for a, b in digests)), dtype=np.uint8).reshape(-1, 2, 32),
    }
    for member, array in arrays.items():
        with task.output(f"{name}.{member}.npy") as stream:
            stream.write(array_bytes(array))
    with task.output(f"{name}.lineage.jsonl") as stream:
        for lineage in lineages:
            stream.write(json_bytes(lineage))


@dataclass(frozen=True)
class FoundVariants:
    """The variants of one search shard, read from disk when they are needed; arrays as in the module's docstring."""

    name: str
    types: np.ndarray
    origins: np.ndarray
    poses: np.ndarray
    stretched: np.ndarray
    stretches: np.ndarray
    edges: np.ndarray
    labels: np.ndarray
    offsets: np.ndarray
    numbers: np.ndarray
    keys: np.ndarray
    features: np.ndarray
    digests: np.ndarray
    lineage_path: Path

    @classmethod
    def of(cls, task: Task, shard: str) -> FoundVariants:
        """Open what `shard`, one of the inputs, found."""
        arrays = {member: _mapped(task.input("variations", f"{shard}.{member}.npy")) for member in _FOUND}
        return cls(shard, lineage_path=task.input("variations", f"{shard}.lineage.jsonl"), **arrays)

    def __len__(self) -> int:
        return len(self.keys)

    def assembly(self, index: int) -> tuple[Assembly, IntArray]:
        """Return one variant and the docking labels of its edges."""
        (part, edge), (last_part, last_edge) = self.offsets[index].tolist(), self.offsets[index + 1].tolist()
        first, last = np.searchsorted(self.stretched, [part, last_part]).tolist()
        assembly = Assembly(
            np.array(self.types[part:last_part]),
            np.array(self.poses[part:last_part]),
            np.array(self.edges[edge:last_edge]),
            np.array(self.stretches[first:last]) if last > first else None,
        )
        return assembly, np.array(self.labels[edge:last_edge])

    def origins_of(self, index: int) -> np.ndarray:
        """Return the exemplar that each part of one variant came from, int8 (n,)."""
        return np.array(self.origins[self.offsets[index, 0] : self.offsets[index + 1, 0]])

    def counts(self, index: int, types: int) -> np.ndarray:
        """Return the number of parts of one variant by type, int32 (types,)."""
        part_types = self.types[self.offsets[index, 0] : self.offsets[index + 1, 0]]
        return np.bincount(part_types, minlength=types).astype(np.int32)

    @cached_property
    def _lineage(self) -> list[bytes]:
        return self.lineage_path.read_bytes().splitlines()

    def described(self, index: int) -> dict[str, Any]:
        """Return the lineage of one variant."""
        lineage: dict[str, Any] = json.loads(self._lineage[self.numbers[index]])
        return lineage

    def lineages(self) -> Iterator[dict[str, Any]]:
        """Yield the lineage of each variant that the search found, kept or not, in order of their numbers."""
        yield from map(json.loads, self._lineage)

    def name_of(self, index: int) -> str:
        """Return the name of one variant in the search."""
        return f"{self.name}-{self.numbers[index]}"

    def digest(self, index: int) -> str:
        """Return the hex digest of one variant's canonical graph."""
        return bytes(self.digests[index, 0]).hex()


@dataclass(frozen=True)
class PoolIndex:
    """What the pools of a kit have kept, in order."""

    searches: tuple[str, ...]  # names of search shards
    rows: np.ndarray  # int64 (k, 2), index in `searches` of each variant, and index there
    counts: np.ndarray  # int32 (k, types), parts by type
    features: np.ndarray  # float32 (k, 10)
    keys: np.ndarray  # uint64 (k, 2)
    digests: np.ndarray  # uint8 (k, 2, 32)

    @classmethod
    def of(cls, task: Task, kit: str, types: int) -> PoolIndex:
        """Read the pools among a shard's inputs; `kit` has `types` types."""
        names = [shard.partition("/")[2] for shard in task.shard.inputs]
        searches: dict[str, int] = {}
        rows = [np.empty((0, 2), np.int64)]
        parts: dict[str, list[np.ndarray]] = {
            "counts": [np.empty((0, types), np.int32)],
            "features": [np.empty((0, len(AXES)), np.float32)],
            "keys": [np.empty((0, 2), np.uint64)],
            "digests": [np.empty((0, 2, 32), np.uint8)],
        }
        for pool in sorted(name for name in names if re.fullmatch(rf"{kit}-r\d+-pool", name)):
            kept = np.load(task.input("variations", f"{pool}.kept.npy"), allow_pickle=False)
            round_name = pool.removesuffix("-pool")
            numbers = [searches.setdefault(search_name(round_name, k), len(searches)) for k in kept[:, 0].tolist()]
            rows.append(np.stack([np.array(numbers, dtype=np.int64), kept[:, 1]], axis=1))
            for member, arrays in parts.items():
                arrays.append(np.load(task.input("variations", f"{pool}.{member}.npy"), allow_pickle=False))
        joined = {member: np.concatenate(arrays) for member, arrays in parts.items()}
        return cls(tuple(searches), np.concatenate(rows), **joined)

    def __len__(self) -> int:
        return len(self.rows)

    def variants(self, task: Task, chosen: Sequence[int]) -> Iterator[tuple[FoundVariants, int]]:
        """Yield variants, each as what its search found and its index there.

        Files are opened when first needed and closed after their last variant: pages of mapped files count as memory.
        """
        opened: dict[int, FoundVariants] = {}
        rows = self.rows[np.asarray(chosen, dtype=np.int64)].tolist()
        last = {number: place for place, (number, _) in enumerate(rows)}
        for place, (number, index) in enumerate(rows):
            if number not in opened:
                opened[number] = FoundVariants.of(task, self.searches[number])
            yield opened[number], index
            if place == last[number]:
                del opened[number]


def write_kept(
    task: Task, found: Sequence[FoundVariants], kept: Sequence[tuple[int, int]], types: int
) -> dict[str, np.ndarray]:
    """Write the index of the variants that a pool shard keeps; return its arrays by name.

    kept: search and index there of each variant
    """
    name = task.shard.name
    arrays: dict[str, np.ndarray] = {
        "kept": np.array(kept, dtype=np.int64).reshape(-1, 2),
        "counts": np.array([found[search].counts(index, types) for search, index in kept], np.int32).reshape(-1, types),
        "features": np.array([found[search].features[index] for search, index in kept], np.float32).reshape(
            -1, len(AXES)
        ),
        "keys": np.array([found[search].keys[index] for search, index in kept], np.uint64).reshape(-1, 2),
        "digests": np.array([found[search].digests[index] for search, index in kept], np.uint8).reshape(-1, 2, 32),
    }
    for member, array in arrays.items():
        with task.output(f"{name}.{member}.npy") as stream:
            stream.write(array_bytes(array))
    return arrays


def _mapped(path: Path) -> np.ndarray:
    """Return an array on disk, mapped; an empty one, which cannot be mapped, is loaded."""
    empty = len(np.load(path, mmap_mode=None, allow_pickle=False)) == 0 if path.stat().st_size < 4096 else False
    array: np.ndarray = np.load(path, mmap_mode=None if empty else "r", allow_pickle=False)
    return array
