"""Which way a shape faces: as most of its parts do in the exemplars.

A search puts parts together from any of them on, so a cabinet may come out with its back to where the exemplar has its
front; whoever looks at a sheet, or trains on a dataset, wants them all one way round.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Kit

DEGREES = 5
"""Turns that differ by less may count as one; unit: degrees."""
BETTER = 0.5
"""So many more contacts must be for a turn."""
EXACT = 0.05
"""A turn that differs from quarter turns by less is taken for one; unit: degrees."""


class OrientationFix:
    """In which directions parts touch each other in the exemplars of a kit."""

    def __init__(self, kit: Kit) -> None:
        self._up = {"y": 1, "z": 2}[kit.up]
        self._across, self._along = (self._up + 1) % 3, (self._up + 2) % 3
        self._tolerance = 2 * kit.pose_tolerance
        keys, offsets = zip(*(self._contacts(each.assembly) for each in kit.exemplars), strict=True)
        joined, where = np.concatenate(keys), np.concatenate(offsets)
        self._seen: dict[int, FloatArray] = {}
        for key in np.unique(joined).tolist():
            there = where[joined == key]
            _, first = np.unique(np.round(there / self._tolerance), axis=0, return_index=True)
            self._seen[key] = there[np.sort(first)]

    def turn(self, assembly: Assembly) -> float:
        """By which angle an assembly is turned about the vertical axis from where most of its contacts lie in a
        direction in which they lie in an exemplar; 0 where no turn is better. What is seen in several directions says
        the less. Unit: degrees, 0 to 360."""
        votes = np.zeros(360 // DEGREES)
        exact = np.zeros(len(votes))
        keys, offsets = self._contacts(assembly)
        for key in np.unique(keys).tolist():
            angles, contact = self._turns(offsets[keys == key], self._seen.get(key, np.empty((0, 3))))
            bins = np.round(angles / DEGREES).astype(np.int64) % len(votes)
            pairs, first = np.unique(np.stack([contact, bins], axis=1), axis=0, return_index=True)
            alike = np.bincount(pairs[:, 0])
            np.add.at(votes, pairs[:, 1], 1 / alike[pairs[:, 0]])
            exact[pairs[:, 1]] = angles[first]
        best = int(votes.argmax())
        if votes[best] < votes[0] + BETTER:
            return 0.0
        quarters = round(float(exact[best]) / 90)
        return float(90 * quarters if abs(exact[best] - 90 * quarters) < EXACT else exact[best]) % 360

    def turned_back(self, assembly: Assembly, degrees: float) -> Assembly:
        """The assembly before it was turned so far; the same one where it is not."""
        if not degrees:
            return assembly
        return replace(assembly, poses=vertical_turn(self._up, -degrees) @ assembly.poses)

    def _contacts(self, assembly: Assembly) -> tuple[np.ndarray, FloatArray]:
        """Of each contact a number of the types of its parts, int (m,), and the way from the centre of the part of the
        lesser type to that of the other, float64 (m, 3); those of parts of one type say nothing of a direction, and
        are left out."""
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        first, second = assembly.types[i].astype(np.int64), assembly.types[j].astype(np.int64)
        swapped = first > second
        way = (assembly.poses[j, :3, 3] - assembly.poses[i, :3, 3]) * np.where(swapped, -1.0, 1.0)[:, None]
        keys = np.minimum(first, second) << 32 | np.maximum(first, second)
        differ = first != second
        return keys[differ], way[differ]

    def _turns(self, ways: FloatArray, seen: FloatArray) -> tuple[FloatArray, np.ndarray]:
        """By which angles (k,), in degrees, about the vertical axis ways (n, 3) are turned from those `seen` (m, 3) as
        long and as steep, and which way each is of, int (k,). What leads straight up or down has no direction."""
        level = [np.hypot(each[:, self._across], each[:, self._along]) for each in (ways, seen)]
        alike = np.abs(level[0][:, None] - level[1][None]) < self._tolerance
        alike &= np.abs(ways[:, None, self._up] - seen[None, :, self._up]) < self._tolerance
        alike &= level[0][:, None] > 2 * self._tolerance
        way, which = np.nonzero(alike)
        first, second = ways[way], seen[which]
        turns: FloatArray = np.arctan2(first[:, self._along], first[:, self._across])
        turns -= np.arctan2(second[:, self._along], second[:, self._across])
        return np.degrees(turns), way


def vertical_turn(up: int, degrees: float) -> FloatArray:
    """The turn (4, 4) about axis number `up`; exact for quarter turns."""
    across, along = (up + 1) % 3, (up + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    if degrees % 90 == 0:
        cosine, sine = np.round(cosine), np.round(sine)
    motion = np.eye(4)
    motion[[across, along], [across, along]] = cosine
    motion[along, across], motion[across, along] = sine, -sine
    return motion
