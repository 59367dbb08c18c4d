"""What a variant is like, in ten numbers: the axes along which the search and the selection want variety."""

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
"""Mixture from which on a shape counts as mixed: a tenth of its parts from other exemplars than its main one."""


class FeatureExtractor:
    """The features of assemblies of one kit."""

    def __init__(self, kit: Kit) -> None:
        bounds = np.stack([each.bounds for each in kit.types])
        self._centres = bounds.mean(axis=1)
        self._halves = (bounds[:, 1] - bounds[:, 0]) / 2
        self._up = {"y": 1, "z": 2}[kit.up]
        self._types = len(kit.types)
        rng = np.random.Generator(np.random.PCG64(self._types))
        self._weights = rng.integers(1, 2**63, (2, self._types), dtype=np.uint64)
        seen = [np.unique(self._neighbourhoods(each.assembly)) for each in kit.exemplars]
        rules, first, times = np.unique(np.concatenate(seen), return_index=True, return_counts=True)
        owners = np.repeat(np.arange(len(seen)), [len(each) for each in seen])
        self._rules, self._owners = rules, np.where(times == 1, owners[first], -1).astype(np.int8)
        self._exemplars = [np.bincount(each.assembly.types, minlength=self._types) for each in kit.exemplars]

    def features(self, assembly: Assembly, shares: FloatArray, marks: np.ndarray, copied: float) -> Float32Array:
        """The ten features of an assembly, float32 (10,), in the order of AXES.

        parts: how many; footprint: area of the box around it seen from above, in squared kit units; height: of that
        box, in kit units; aspect: longer by shorter side of the footprint; cycle_rank: edges beyond a spanning tree;
        mixture: share of parts that are not of the exemplar that gave most; blend: among parts with a neighbourhood
        that only one exemplar shows, the share that is not of the exemplar shown most; distance: the histogram metric E
        to the nearest exemplar (strings §5.3), 0 to 1; copied: share of parts in the largest piece that stands rigidly
        so in one exemplar; dominant: the type that most parts have.
        shares: `material_shares` of the assembly; marks: int8 (n,) of `marks`; copied: `Copied.largest`.
        """
        centres = self._centres[assembly.types]
        turns, places = assembly.placements[:, :3, :3], assembly.poses[:, :3, 3]
        middles = np.einsum("nij,nj->ni", turns, centres) + places
        reach = np.einsum("nij,nj->ni", np.abs(turns), self._halves[assembly.types])
        spans = (middles + reach).max(axis=0) - (middles - reach).min(axis=0)
        sides = np.delete(spans, self._up)
        counts = np.bincount(assembly.types, minlength=self._types)
        distance = min(histogram_metric(counts, each) for each in self._exemplars)
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
        """For each part the exemplar that alone shows its neighbourhood, or -1 where none or several do, int8 (n,)."""
        keys = self._neighbourhoods(assembly)
        at = np.searchsorted(self._rules, keys).clip(0, len(self._rules) - 1)
        return np.where(self._rules[at] == keys, self._owners[at], -1).astype(np.int8)

    def _neighbourhoods(self, assembly: Assembly) -> np.ndarray:
        """A hash of the type and the neighbour types of each part, uint64 (n,)."""
        keys: np.ndarray = self._weights[0][assembly.types]
        np.add.at(keys, assembly.edges[:, 0], self._weights[1][assembly.types[assembly.edges[:, 1]]])
        np.add.at(keys, assembly.edges[:, 1], self._weights[1][assembly.types[assembly.edges[:, 0]]])
        return keys


def material_shares(origins: Sequence[int] | np.ndarray, exemplars: int) -> FloatArray:
    """The share of parts that each of the exemplars gave, float64 (exemplars,), from the parts' origins (n,)."""
    counts = np.bincount(np.asarray(origins, dtype=np.int64), minlength=exemplars)
    return np.asarray(counts / max(counts.sum(), 1), dtype=np.float64)
