"""Resizing: a part is made taller or lower, and the parts attached to it move along (substructures §5.3, figure 11)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit
from stages.shape.stretch import moved_by
from stages.variations.requirements.named_labels import named_labels

UP = {"y": 1, "z": 2}


def heights_of(kit: Kit, assembly: Assembly) -> FloatArray:
    """Return the height of each part's centroid, float64 (n,)."""
    centroids = np.stack([kit.types[index].centroid for index in assembly.types])
    placed, up = assembly.placements, UP[kit.up]
    heights: FloatArray = np.einsum("nj,nj->n", placed[:, up, :3], centroids) + placed[:, up, 3]
    return heights


def spans_of(kit: Kit, assembly: Assembly) -> FloatArray:
    """Return the heights of each part's lowest and highest point, float64 (n, 2)."""
    up, spans = UP[kit.up], []
    for part_type, placed in zip(assembly.types.tolist(), assembly.placements, strict=True):
        heights = kit.types[part_type].vertices @ placed[up, :3] + placed[up, 3]
        spans.append((heights.min(), heights.max()))
    return np.array(spans)


def rigid_types(kit: Kit, rigid: Sequence[str]) -> BoolArray:
    """Return which types of a kit have a label that is never stretched, bool (types,).

    Raise ConfigError for a label that no part has.
    """
    is_rigid: BoolArray = named_labels(kit, rigid, "variations.search.stretch.rigid")[kit.label_of]
    return is_rigid


class Resizer:
    """Resizes parts of a kit's assemblies in height.

    max_factor: how much taller or lower a part may become
    rigid: labels of parts that are never resized
    """

    def __init__(self, kit: Kit, max_factor: float, rigid: Sequence[str]) -> None:
        self.kit, self.max_factor = kit, max_factor
        self._rigid = rigid_types(kit, rigid)

    def may(self, assembly: Assembly, part: int, factor: float) -> bool:
        """Return whether a part may be scaled in height by a factor."""
        up = UP[self.kit.up]
        total = factor * np.linalg.norm(assembly.placements[part, up, :3])
        return bool(1 / self.max_factor <= total <= self.max_factor and not self._rigid[assembly.types[part]])

    def meeting(self, assembly: Assembly, part: int, other: int, end: int) -> float:
        """Return the height where two parts meet: the lower (end 0) or upper (end 1) end of what their spans share."""
        spans = spans_of(self.kit, assembly.select(np.sort([part, other])))
        return float(spans[:, 1].min() if end else spans[:, 0].max())

    def stretched(self, assembly: Assembly, part: int, factor: float, level: float) -> Assembly | None:
        """Return the assembly with one part scaled about a height while all others stay, or None where that is not
        allowed.
        """
        return self._resized(assembly, part, factor, level, np.zeros(len(assembly)))

    def resized(self, assembly: Assembly, part: int, factor: float, held: int, end: int) -> Assembly | None:
        """Return the assembly with one part scaled about the height where it meets its neighbour `held`.

        `held` and everything attached to it stay; what is attached to the part elsewhere moves along. None where
        scaling is not allowed or something would have to move in two ways at once.
        end: as for `meeting`
        """
        level = self.meeting(assembly, part, held, end)
        shifts = self._shifts(assembly, part, factor, level, held, end)
        return None if shifts is None else self._resized(assembly, part, factor, level, shifts)

    def _resized(
        self, assembly: Assembly, part: int, factor: float, level: float, shifts: FloatArray
    ) -> Assembly | None:
        if not self.may(assembly, part, factor):
            return None
        up = UP[self.kit.up]
        motions = np.tile(np.eye(4), (len(assembly), 1, 1))
        motions[part, up, up], motions[part, up, 3] = factor, (1.0 - factor) * level
        motions[:, up, 3] += shifts
        return moved_by(assembly, motions)

    def _shifts(
        self, assembly: Assembly, part: int, factor: float, level: float, held: int, end: int
    ) -> FloatArray | None:
        """Return how far up each part moves as `part` is resized, float64 (n,).

        A part moves as far as the place where it, or what it is attached to, meets the resized part. None on
        contradiction.
        """
        neighbours = assembly.neighbours()
        shifts = np.full(len(assembly), np.nan)
        shifts[part] = 0.0
        for other in [held, *(neighbour for neighbour in neighbours[part] if neighbour != held)]:
            meets = self.meeting(assembly, part, other, end)
            shift = 0.0 if other == held else (factor - 1.0) * (meets - level)
            waiting = [other]
            while waiting:
                at = waiting.pop()
                if at != part and np.isnan(shifts[at]):
                    shifts[at] = shift
                    waiting += neighbours[at]
            if abs(shifts[other] - shift) > self.kit.contact_tolerance:
                return None
        return np.asarray(np.nan_to_num(shifts))  # parts that are not attached to it stay
