"""What a variant is like, in eight numbers: the axes along which the search and the selection want variety."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray
from stages.shape.kit import Assembly, Kit

__all__ = ["AXES", "Axis", "FeatureTest", "material_shares"]

Axis = Literal["parts", "footprint", "height", "aspect", "cycle_rank", "mixture", "distance", "dominant"]
AXES: tuple[Axis, ...] = get_args(Axis)


class FeatureTest:
    """The features of assemblies of one kit."""

    def __init__(self, kit: Kit) -> None:
        bounds = np.stack([each.bounds for each in kit.types])
        self._centres = bounds.mean(axis=1)
        self._halves = (bounds[:, 1] - bounds[:, 0]) / 2
        self._up = {"y": 1, "z": 2}[kit.up]
        self._types = len(kit.types)
        self._exemplars = [np.bincount(each.assembly.types, minlength=self._types) for each in kit.exemplars]

    def features(self, assembly: Assembly, shares: FloatArray) -> Float32Array:
        """The eight features of an assembly, float32 (8,), in the order of AXES.

        parts: how many; footprint: area of the box around it seen from above, in squared kit units; height: of that
        box, in kit units; aspect: longer by shorter side of the footprint; cycle_rank: edges beyond a spanning tree;
        mixture: share of parts that are not of the exemplar that gave most; distance: the histogram metric E to the
        nearest exemplar (strings §5.3), 0 to 1; dominant: the type that most parts have.
        shares: `material_shares` of the assembly.
        """
        centres = self._centres[assembly.types]
        turns, places = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
        middles = np.einsum("nij,nj->ni", turns, centres) + places
        reach = np.einsum("nij,nj->ni", np.abs(turns), self._halves[assembly.types])
        spans = (middles + reach).max(axis=0) - (middles - reach).min(axis=0)
        sides = np.delete(spans, self._up)
        counts = np.bincount(assembly.types, minlength=self._types)
        distance = min(np.abs(counts - each).sum() / (len(assembly) + each.sum()) for each in self._exemplars)
        return np.array(
            [
                len(assembly),
                sides[0] * sides[1],
                spans[self._up],
                sides.max() / max(sides.min(), 1e-9),
                len(assembly.edges) - len(assembly) + 1,
                1.0 - shares.max(),
                distance,
                counts.argmax(),
            ],
            dtype=np.float32,
        )


def material_shares(origins: Sequence[int] | np.ndarray, exemplars: int) -> FloatArray:
    """The share of parts that each of the exemplars gave, float64 (exemplars,), from the parts' origins (n,)."""
    counts = np.bincount(np.asarray(origins, dtype=np.int64), minlength=exemplars)
    return np.asarray(counts / max(counts.sum(), 1), dtype=np.float64)
