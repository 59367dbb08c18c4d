"""Resizing: a part is made taller or lower, and what hangs on it moves along, so that a global constraint is met
(substructures §5.3, figure 11)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit
from stages.shape.stretch import moved_by
from stages.variations.requirements.named_labels import named_labels

UP = {"y": 1, "z": 2}


def heights_of(kit: Kit, assembly: Assembly) -> FloatArray:
    """The height of the centroid of each part, float64 (n,)."""
    centroids = np.stack([kit.types[index].centroid for index in assembly.types])
    placed, up = assembly.placements, UP[kit.up]
    heights: FloatArray = np.einsum("nj,nj->n", placed[:, up, :3], centroids) + placed[:, up, 3]
    return heights


def spans_of(kit: Kit, assembly: Assembly) -> FloatArray:
    """The heights of the lowest and of the highest point of each part, float64 (n, 2)."""
    up, spans = UP[kit.up], []
    for part_type, placed in zip(assembly.types.tolist(), assembly.placements, strict=True):
        heights = kit.types[part_type].vertices @ placed[up, :3] + placed[up, 3]
        spans.append((heights.min(), heights.max()))
    return np.array(spans)


def rigid_types(kit: Kit, rigid: Sequence[str]) -> BoolArray:
    """Which types of a kit have a label that is never stretched, bool (types,). Raises ConfigError for labels that it
    has not."""
    found: BoolArray = named_labels(kit, rigid, "variations.search.stretch.rigid")[kit.label_of]
    return found


class Resizer:
    """Resizes the parts of a kit's assemblies in height, each by `most` at most, those of labels `rigid` never."""

    def __init__(self, kit: Kit, most: float, rigid: Sequence[str]) -> None:
        self.kit, self.max_factor = kit, most
        self._rigid = rigid_types(kit, rigid)

    def may(self, assembly: Assembly, part: int, factor: float) -> bool:
        """Whether a part may be made so many times taller."""
        up = UP[self.kit.up]
        made = factor * np.linalg.norm(assembly.placements[part, up, :3])
        return bool(1 / self.max_factor <= made <= self.max_factor and not self._rigid[assembly.types[part]])

    def meeting(self, assembly: Assembly, part: int, other: int, end: int) -> float:
        """The height at which two parts meet: the lower (0) or the upper (1) end of what their spans have in common."""
        spans = spans_of(self.kit, assembly.select(np.sort([part, other])))
        return float(spans[:, 1].min() if end else spans[:, 0].max())

    def stretched(self, assembly: Assembly, part: int, factor: float, level: float) -> Assembly | None:
        """The assembly with one part made so many times taller about a height, while all others stay; None where it may
        not be."""
        return self._resized(assembly, part, factor, level, np.zeros(len(assembly)))

    def resized(self, assembly: Assembly, part: int, factor: float, held: int, end: int) -> Assembly | None:
        """The assembly with one part made so many times taller about the height at which it meets its neighbour `held`.
        That stays where it is, with all that hangs on it, and what hangs on the part elsewhere moves along. None where
        it may not be, or where something would have to move in two ways at once. end: as for `meeting`.
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
        """How far up each part goes as `part` is resized, float64 (n,): as far as the place where it, or what it hangs
        on, meets that part."""
        neighbours = assembly.neighbours()
        shifts = np.full(len(assembly), np.nan)
        shifts[part] = 0.0
        for other in [held, *(each for each in neighbours[part] if each != held)]:
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
        found: FloatArray = np.nan_to_num(shifts)  # what does not hang on it at all stays
        return found
