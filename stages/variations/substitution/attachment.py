"""Support of parts that go by meaning: where a part always touched others it touches something still (substructures
§5.3).

A grammar of meanings counts the neighbours of a part, and where many parts mean the same it says little else: a shelf
between two uprights, all of them boards, might hang from one, and an upright end in the air. Here the sides of the box
around a part, and the halves of each side, tell where it is held.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit

NEAR = 0.6
"""A contact is at a side where its centre is so far out from the middle of the box, as a share of the way to the side;
and surely at the one across which the boxes of both parts have least in common."""
HALF, CLEAR_HALF = 0.2, 0.4
"""It is in a half of that side where it is so far from the middle towards that half's end, and surely so."""
ALONG = 0.9
"""Least cosine between a direction and an axis of a part that point the same way."""
AXES = np.concatenate([-np.eye(3), np.eye(3)])
"""The sides of a box: low ones, then high ones."""


class HoldTest:
    """Tells shapes in which a part has nothing at a side, or in a half of one, where each part of its mesh touched
    another in the exemplars; the ground is something too, where that was always beneath. tolerance: how far above the
    lowest point of a shape its ground reaches, in kit units."""

    def __init__(self, kit: Kit, tolerance: float) -> None:
        self.kit, self.tolerance = kit, tolerance
        self._up = AXES[3 + {"y": 1, "z": 2}[kit.up]]
        self._turned = [_turned_sides(each.symmetries[:, :3, :3]) for each in kit.types]
        self._needed = np.ones((len(kit.types), 6, 6), dtype=bool)
        self._beneath = np.ones((len(kit.types), 6), dtype=bool)
        for each in kit.exemplars:
            rows = zip(each.assembly.types, self._held(each.assembly, True), self._down(each.assembly), strict=True)
            for part_type, held, down in rows:
                ways = [(self._needed[part_type] & _at(turned, held), turned) for turned in self._turned[part_type]]
                self._needed[part_type], turned = max(ways, key=lambda way: int(way[0].sum()))
                self._beneath[part_type] &= down[turned]
        present = np.concatenate([each.assembly.types for each in kit.exemplars])
        self._needed[~np.isin(np.arange(len(kit.types)), present)] = False

    def is_loose(self, assembly: Assembly) -> bool:
        """Whether a part lacks what holds it; a part that looks the same when it is turned may be held turned so."""
        lowest = (self._corners(assembly)[1] @ self._up).min(axis=1)
        stands = lowest <= lowest.min() + self.tolerance
        rows = zip(assembly.types, self._held(assembly, False), self._down(assembly) & stands[:, None], strict=True)
        for part_type, held, ground in rows:
            lacks = [
                self._needed[part_type] & ~_at(turned, held) & ~(ground[turned] & self._beneath[part_type])[:, None]
                for turned in self._turned[part_type]
            ]
            if all(each.any() for each in lacks):
                return True
        return False

    def _down(self, assembly: Assembly) -> BoolArray:
        """Which side of each part faces down, bool (n, 6)."""
        found: BoolArray = -np.einsum("nji,j->ni", assembly.poses[:, :3, :3], self._up) @ AXES.T >= ALONG
        return found

    def _corners(self, assembly: Assembly) -> tuple[FloatArray, FloatArray]:
        """The boxes of the parts in their own coordinates, float64 (n, 2, 3), and their corners in the world,
        (n, 8, 3)."""
        bounds = np.stack([self.kit.types[each].bounds for each in assembly.types])
        corners = bounds[:, [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], [0, 1, 2]]
        placed = assembly.placements
        return bounds, np.einsum("nij,ncj->nci", placed[:, :3, :3], corners) + placed[:, None, :3, 3]

    def _held(self, assembly: Assembly, surely: bool) -> BoolArray:
        """Where each part touches something, bool (n, 6, 6): at a side, and there in the half towards another side;
        where both are the same side, anywhere at it."""
        held = np.zeros((len(assembly), 6, 6), dtype=bool)
        (bounds, world), placed = self._corners(assembly), assembly.placements
        for part, other in np.concatenate([assembly.edges, assembly.edges[:, ::-1]]).tolist():
            back = np.linalg.inv(placed[part])
            seen = world[other] @ back[:3, :3].T + back[:3, 3]
            low, high = np.maximum(seen.min(axis=0), bounds[part, 0]), np.minimum(seen.max(axis=0), bounds[part, 1])
            half = np.maximum(np.ptp(bounds[part], axis=0) / 2, 1e-12)
            out = ((low + high) / 2 - bounds[part].mean(axis=0)) / half
            far = np.concatenate([-out, out])
            sides = far >= NEAR
            if surely:
                sides &= np.arange(6) % 3 == (high - low).argmin()
            held[part] |= sides[:, None] & ((far >= (CLEAR_HALF if surely else HALF)) | np.eye(6, dtype=bool))
        return held


def _at(turned: np.ndarray, held: BoolArray) -> BoolArray:
    """What holds a part, (6, 6), as if it were turned."""
    found: BoolArray = held[np.ix_(turned, turned)]
    return found


def _turned_sides(rotations: FloatArray) -> list[np.ndarray]:
    """For each rotation (k, 3, 3) that turns axes to axes, to which side each of the six comes."""
    cosines = np.einsum("kij,aj,bi->kab", rotations, AXES, AXES)
    return [each.argmax(axis=1) for each in cosines if (each.max(axis=1) >= ALONG).all()]
