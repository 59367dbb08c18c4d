"""The ten features of a variant: the axes along which search and selection want variety."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.kit import Assembly, Kit

Axis = Literal[
    "parts",
    "footprint",
    "height",
    "aspect",
    "cycle_rank",
    "mixture",
    "neighbourhood_mixture",
    "distance",
    "copied_share",
    "dominant",
]
AXES: tuple[Axis, ...] = get_args(Axis)
MIN_MIXTURE = 0.1
"""Smallest share of parts from other exemplars than the main one in a shape that counts as mixed."""


class FeatureExtractor:
    """Computes the features of assemblies of one kit."""

    def __init__(self, kit: Kit) -> None:
        bounds = np.stack([part_type.bounds for part_type in kit.types])
        self._centres = bounds.mean(axis=1)
        self._halves = (bounds[:, 1] - bounds[:, 0]) / 2
        self._up = {"y": 1, "z": 2}[kit.up]
        self._types = len(kit.types)
        rng = np.random.Generator(np.random.PCG64(self._types))
        self._weights = rng.integers(1, 2**63, (2, self._types), dtype=np.uint64)
        seen = [np.unique(self._neighbourhoods(exemplar.assembly)) for exemplar in kit.exemplars]
        rules, first, times = np.unique(np.concatenate(seen), return_index=True, return_counts=True)
        owners = np.repeat(np.arange(len(seen)), [len(keys) for keys in seen])
        self._rules, self._owners = rules, np.where(times == 1, owners[first], -1).astype(np.int8)
        self._exemplars = [np.bincount(exemplar.assembly.types, minlength=self._types) for exemplar in kit.exemplars]

    def features(self, assembly: Assembly, shares: FloatArray, marks: np.ndarray, copied: float) -> Float32Array:
        """Return the ten features of an assembly, float32 (10,), in the order of AXES.

        parts: number of parts
        footprint: area of the bounding box seen from above, in squared kit units
        height: height of the bounding box, in kit units
        aspect: longer by shorter side of the footprint
        cycle_rank: number of edges beyond a spanning tree
        mixture: share of parts from other exemplars than the main one
        neighbourhood_mixture: among parts whose neighbourhood only one exemplar shows, the share of minority exemplars
        distance: histogram metric E to the nearest exemplar (strings §5.3), 0 to 1
        copied_share: share of parts in the largest verbatim piece of one exemplar
        dominant: the most frequent type

        Arguments besides the assembly:
        shares: float64 (exemplars,), as from `material_shares`
        marks: int8 (n,), as from `marks`
        copied: `CopiedPieces.largest`
        """
        centres = self._centres[assembly.types]
        turns, places = assembly.placements[:, :3, :3], assembly.poses[:, :3, 3]
        middles = np.einsum("nij,nj->ni", turns, centres) + places
        reach = np.einsum("nij,nj->ni", np.abs(turns), self._halves[assembly.types])
        spans = (middles + reach).max(axis=0) - (middles - reach).min(axis=0)
        sides = np.delete(spans, self._up)
        counts = np.bincount(assembly.types, minlength=self._types)
        distance = min(histogram_metric(counts, exemplar) for exemplar in self._exemplars)
        return np.array(
            [
                len(assembly),
                sides[0] * sides[1],
                spans[self._up],
                sides.max() / max(sides.min(), 1e-9),
                len(assembly.edges) - len(assembly) + 1,
                1.0 - shares.max(),
                1.0 - material_shares(marks[marks >= 0], len(self._exemplars)).max() if (marks >= 0).any() else 0.0,
                distance,
                copied,
                counts.argmax(),
            ],
            dtype=np.float32,
        )

    def marks(self, assembly: Assembly) -> np.ndarray:
        """Return for each part the only exemplar that shows its neighbourhood, or -1, int8 (n,)."""
        keys = self._neighbourhoods(assembly)
        at = np.searchsorted(self._rules, keys).clip(0, len(self._rules) - 1)
        return np.where(self._rules[at] == keys, self._owners[at], -1).astype(np.int8)

    def _neighbourhoods(self, assembly: Assembly) -> np.ndarray:
        """Return a hash of the type and the neighbour types of each part, uint64 (n,)."""
        keys: np.ndarray = self._weights[0][assembly.types]
        np.add.at(keys, assembly.edges[:, 0], self._weights[1][assembly.types[assembly.edges[:, 1]]])
        np.add.at(keys, assembly.edges[:, 1], self._weights[1][assembly.types[assembly.edges[:, 0]]])
        return keys


def material_shares(origins: Sequence[int] | np.ndarray, exemplars: int) -> FloatArray:
    """Return the share of parts from each exemplar, float64 (exemplars,), given the parts' origins (n,)."""
    counts = np.bincount(np.asarray(origins, dtype=np.int64), minlength=exemplars)
    return np.asarray(counts / max(counts.sum(), 1), dtype=np.float64)
