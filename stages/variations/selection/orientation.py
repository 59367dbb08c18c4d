"""The orientation fix: a variant is turned so that it faces as the exemplars do.

A search starts from any part, so a cabinet may come out with its back where the exemplar has its front.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Kit

BIN_DEGREES = 5
"""Width of the bins in which turns are counted, in degrees."""
MIN_CONTACT_GAIN = 0.5
"""Number of contacts by which a turn must be better than none."""
SNAP_DEGREES = 0.05
"""A turn that differs from a quarter turn by less than this many degrees is that quarter turn."""


class OrientationFix:
    """Knows in which directions parts touch each other in the exemplars of a kit."""

    def __init__(self, kit: Kit) -> None:
        self._up = {"y": 1, "z": 2}[kit.up]
        self._across, self._along = (self._up + 1) % 3, (self._up + 2) % 3
        self._tolerance = 2 * kit.pose_tolerance
        keys, offsets = zip(*(self._contacts(exemplar.assembly) for exemplar in kit.exemplars), strict=True)
        joined, vectors_of_all = np.concatenate(keys), np.concatenate(offsets)
        self._seen: dict[int, FloatArray] = {}
        for key in np.unique(joined).tolist():
            vectors = vectors_of_all[joined == key]
            _, first = np.unique(np.round(vectors / self._tolerance), axis=0, return_index=True)
            self._seen[key] = vectors[np.sort(first)]

    def turn(self, assembly: Assembly) -> float:
        """Return the angle about the vertical by which an assembly is turned from the exemplars, in degrees, 0 to 360.

        Under it most contacts have a direction that they have in an exemplar; 0 where no turn is better. A contact seen
        in several directions counts less.
        """
        votes = np.zeros(360 // BIN_DEGREES)
        exact = np.zeros(len(votes))
        keys, offsets = self._contacts(assembly)
        for key in np.unique(keys).tolist():
            angles, contact = self._turns(offsets[keys == key], self._seen.get(key, np.empty((0, 3))))
            bins = np.round(angles / BIN_DEGREES).astype(np.int64) % len(votes)
            pairs, first = np.unique(np.stack([contact, bins], axis=1), axis=0, return_index=True)
            alike = np.bincount(pairs[:, 0])
            np.add.at(votes, pairs[:, 1], 1 / alike[pairs[:, 0]])
            exact[pairs[:, 1]] = angles[first]
        best = int(votes.argmax())
        if votes[best] < votes[0] + MIN_CONTACT_GAIN:
            return 0.0
        quarters = round(float(exact[best]) / 90)
        return float(90 * quarters if abs(exact[best] - 90 * quarters) < SNAP_DEGREES else exact[best]) % 360

    def turned_back(self, assembly: Assembly, degrees: float) -> Assembly:
        """Return the assembly turned back by an angle; the same one for 0."""
        if not degrees:
            return assembly
        return replace(assembly, poses=vertical_turn(self._up, -degrees) @ assembly.poses)

    def _contacts(self, assembly: Assembly) -> tuple[np.ndarray, FloatArray]:
        """Return for each contact a key of the types of its parts, int (m,), and the vector between their centres.

        The vector float64 (m, 3) points from the part of the smaller type to the other. Contacts between parts of one
        type have no direction and are left out.
        """
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        first, second = assembly.types[i].astype(np.int64), assembly.types[j].astype(np.int64)
        swapped = first > second
        vector = (assembly.poses[j, :3, 3] - assembly.poses[i, :3, 3]) * np.where(swapped, -1.0, 1.0)[:, None]
        keys = np.minimum(first, second) << 32 | np.maximum(first, second)
        differ = first != second
        return keys[differ], vector[differ]

    def _turns(self, vectors: FloatArray, seen: FloatArray) -> tuple[FloatArray, np.ndarray]:
        """Return the angles (k,) in degrees about the vertical between vectors (n, 3) and `seen` ones (m, 3), and which
        vector each is of, int (k,). Vectors match if they have equal length and slope; vertical ones have no direction.
        """
        level = [np.hypot(rows[:, self._across], rows[:, self._along]) for rows in (vectors, seen)]
        alike = np.abs(level[0][:, None] - level[1][None]) < self._tolerance
        alike &= np.abs(vectors[:, None, self._up] - seen[None, :, self._up]) < self._tolerance
        alike &= level[0][:, None] > 2 * self._tolerance
        vector, which = np.nonzero(alike)
        first, second = vectors[vector], seen[which]
        turns: FloatArray = np.arctan2(first[:, self._along], first[:, self._across])
        turns -= np.arctan2(second[:, self._along], second[:, self._across])
        return np.degrees(turns), vector


def vertical_turn(up: int, degrees: float) -> FloatArray:
    """Return the rotation (4, 4) about axis number `up`; exact for quarter turns."""
    across, along = (up + 1) % 3, (up + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    if degrees % 90 == 0:
        cosine, sine = np.round(cosine), np.round(sine)
    rotation = np.eye(4)
    rotation[[across, along], [across, along]] = cosine
    rotation[along, across], rotation[across, along] = sine, -sine
    return rotation
