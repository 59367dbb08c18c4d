"""Attachment of parts that go by meaning: where a part always touched others it touches something (substructures §5.3).

A grammar of meanings counts the neighbours of a part, which says little where many parts have one label: a shelf
between two uprights, all of them boards, might hang from one. Here the sides of a part's box, and the halves of each
side, tell where it is attached.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit

MIN_SIDE_DISTANCE = 0.6
"""A contact is at a side if its centre is this far out from the middle of the box, as a share of the way to the side.
It is surely there if it is also thinnest across that side.
"""
MIN_HALF_DISTANCE, SURE_HALF_DISTANCE = 0.2, 0.4
"""It is in a half of that side if it is this far from the middle towards the half's end, and surely so from the second.
"""
MIN_AXIS_COSINE = 0.9
"""Cosine from which a direction and an axis of a part point the same way."""
AXES = np.concatenate([-np.eye(3), np.eye(3)])
"""The sides of a box: low ones, then high ones."""


class AttachmentTest:
    """Finds parts without contact at a side, or half of one, where each part of their mesh had one in the exemplars.

    The ground counts as contact where it was always beneath.
    tolerance: height above the lowest point of a shape up to which its ground reaches, in kit units
    """

    def __init__(self, kit: Kit, tolerance: float) -> None:
        self.kit, self.tolerance = kit, tolerance
        self._up = AXES[3 + {"y": 1, "z": 2}[kit.up]]
        self._turned = [_turned_sides(part_type.symmetries[:, :3, :3]) for part_type in kit.types]
        self._needed = np.ones((len(kit.types), 6, 6), dtype=bool)
        self._beneath = np.ones((len(kit.types), 6), dtype=bool)
        for exemplar in kit.exemplars:
            shape = exemplar.assembly
            rows = zip(shape.types, self._held(shape, True), self._down(shape), strict=True)
            for part_type, held, down in rows:
                common = [(self._needed[part_type] & _at(turned, held), turned) for turned in self._turned[part_type]]
                self._needed[part_type], turned = max(common, key=lambda needed: int(needed[0].sum()))
                self._beneath[part_type] &= down[turned]
        present = np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])
        self._needed[~np.isin(np.arange(len(kit.types)), present)] = False

    def is_loose(self, assembly: Assembly) -> bool:
        """Return whether a part lacks a contact that holds it, however its symmetries turn it."""
        lowest = (self._corners(assembly)[1] @ self._up).min(axis=1)
        stands = lowest <= lowest.min() + self.tolerance
        rows = zip(assembly.types, self._held(assembly, False), self._down(assembly) & stands[:, None], strict=True)
        for part_type, held, ground in rows:
            lacks = [
                self._needed[part_type] & ~_at(turned, held) & ~(ground[turned] & self._beneath[part_type])[:, None]
                for turned in self._turned[part_type]
            ]
            if all(missing.any() for missing in lacks):
                return True
        return False

    def _down(self, assembly: Assembly) -> BoolArray:
        """Return which side of each part faces down, bool (n, 6)."""
        faces_down: BoolArray = -np.einsum("nji,j->ni", assembly.poses[:, :3, :3], self._up) @ AXES.T >= MIN_AXIS_COSINE
        return faces_down

    def _corners(self, assembly: Assembly) -> tuple[FloatArray, FloatArray]:
        """Return the boxes of the parts in their own coordinates, float64 (n, 2, 3), and their corners in the world,
        (n, 8, 3).
        """
        bounds = np.stack([self.kit.types[part_type].bounds for part_type in assembly.types])
        corners = bounds[:, [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], [0, 1, 2]]
        placed = assembly.placements
        return bounds, np.einsum("nij,ncj->nci", placed[:, :3, :3], corners) + placed[:, None, :3, 3]

    def _held(self, assembly: Assembly, surely: bool) -> BoolArray:
        """Return where each part touches something, bool (n, 6, 6): at a side, in the half towards another side.

        Where both are the same side: anywhere at it.
        """
        held = np.zeros((len(assembly), 6, 6), dtype=bool)
        (bounds, world), placed = self._corners(assembly), assembly.placements
        for part, other in np.concatenate([assembly.edges, assembly.edges[:, ::-1]]).tolist():
            back = np.linalg.inv(placed[part])
            seen = world[other] @ back[:3, :3].T + back[:3, 3]
            low, high = np.maximum(seen.min(axis=0), bounds[part, 0]), np.minimum(seen.max(axis=0), bounds[part, 1])
            half = np.maximum(np.ptp(bounds[part], axis=0) / 2, 1e-12)
            out = ((low + high) / 2 - bounds[part].mean(axis=0)) / half
            far = np.concatenate([-out, out])
            sides = far >= MIN_SIDE_DISTANCE
            if surely:
                sides &= np.arange(6) % 3 == (high - low).argmin()
            held[part] |= sides[:, None] & (
                (far >= (SURE_HALF_DISTANCE if surely else MIN_HALF_DISTANCE)) | np.eye(6, dtype=bool)
            )
        return held


def _at(turned: np.ndarray, held: BoolArray) -> BoolArray:
    """Return where a part is held, (6, 6), as if it were turned."""
    as_turned: BoolArray = held[np.ix_(turned, turned)]
    return as_turned


def _turned_sides(rotations: FloatArray) -> list[np.ndarray]:
    """Return for each rotation (k, 3, 3) that maps axes to axes where it takes each of the six sides."""
    cosines = np.einsum("kij,aj,bi->kab", rotations, AXES, AXES)
    return [sides.argmax(axis=1) for sides in cosines if (sides.max(axis=1) >= MIN_AXIS_COSINE).all()]
