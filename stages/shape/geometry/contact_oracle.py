"""Contacts of two parts by relative pose: computed from geometry once, then looked up."""

from __future__ import annotations

import copy
import ctypes
from typing import Any, get_args

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_lookup import (
    FORBIDDEN_CONTACT,
    LABEL_BASE,
    NO_CONTACT,
    POSE_QUANTUM,
    UNKNOWN_CONTACT,
    ContactTable,
    contact_key,
    look_up_around,
    quantize_pose,
)
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import invert
from stages.shape.kit import ContactKind, Kit

BORDERLINE_TOLERANCES = 1.06
"""Two parts without contact that are closer than this many contact tolerances are too close to call."""


class ContactOracle:
    """Says how a part of one type and a part of another touch at a relative pose.

    An answer is NO_CONTACT, FORBIDDEN_CONTACT (a contact that no exemplar shows, a nested part, or a gap too close to
    call), or the two directed docking labels, packed in one number. Poses are rounded to POSE_QUANTUM of the contact
    tolerance. Of all images of a pose under the symmetries of both parts, the one with the smallest numbers is
    answered. So an answer never depends on earlier questions.
    """

    def __init__(self, kit: Kit) -> None:
        self.kit = kit
        self.contact = ContactTest(kit.types, kit.contact_tolerance)
        self.dockings = DockingTable.of(kit)
        self.table = _empty_table(1 << 16)
        self.geometry_queries = 0
        self._pending_error: BaseException | None = None
        self._size = 0
        self._penetration = PenetrationTest(kit.types)
        self._of_geometry: dict[bytes, int] = {}
        self._quantum = kit.contact_tolerance * POSE_QUANTUM
        self._is_plain = [np.array_equal(part.symmetries, np.eye(4)[None]) for part in kit.types]
        self._every_kind = set(kit.contact_kinds) == set(get_args(ContactKind))

    def under(self, kit: Kit) -> ContactOracle:
        """Return an oracle with the same knowledge for a kit that differs only in its exemplars and neighbourhoods."""
        other = copy.copy(self)
        other.kit = kit
        other.table = ContactTable(self.table.keys.copy(), self.table.values.copy())
        return other

    def resolve(self, types: np.ndarray, rotations: np.ndarray, translations: np.ndarray, pairs: np.ndarray) -> bool:
        """Learn the contacts of `pairs` int (k, 2) of the parts; return False as soon as one is FORBIDDEN_CONTACT."""
        return all(self._learn(types, rotations, translations, i, j) != FORBIDDEN_CONTACT for i, j in pairs.tolist())

    def c_callback(self, types: np.ndarray, rotations: np.ndarray, translations: np.ndarray) -> Any:
        """Return a C function (int64, int64) -> int64 that answers and learns, for compiled code.

        Its arguments are indices into the arrays int (n,), float64 (n, 3, 3), (n, 3). Call `raise_pending` afterwards:
        no exception can pass through compiled code.
        """

        def answer(i: int, j: int) -> int:
            try:
                return self._learn(types, rotations, translations, i, j)
            except BaseException as error:
                self._pending_error = error
                return FORBIDDEN_CONTACT

        return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(answer)

    def raise_pending(self) -> None:
        """Raise what a `c_callback` could not raise."""
        if self._pending_error is not None:
            error, self._pending_error = self._pending_error, None
            raise error

    def around(self, types: np.ndarray, poses: FloatArray, b: int, pose: FloatArray) -> IntArray:
        """Return the answers int64 (n,) for a part of type `b` at `pose` (4, 4) and each of the parts `types` (n,) at
        `poses` (n, 4, 4). Geometry is not asked where a known answer is FORBIDDEN_CONTACT."""
        rotations, translations = np.ascontiguousarray(poses[:, :3, :3]), np.ascontiguousarray(poses[:, :3, 3])
        rotation, translation = np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3])
        reach, quantum = self.kit.types[b].diagonal / 2, self._quantum
        values: IntArray = look_up_around(
            self.table.keys, self.table.values, types, rotations, translations, b, rotation, translation, reach, quantum
        )
        if not (values == FORBIDDEN_CONTACT).any():
            quanta = np.empty(12, dtype=np.int64)
            for part in np.flatnonzero(values == UNKNOWN_CONTACT).tolist():
                quantize_pose(rotations[part], translations[part], rotation, translation, reach, quantum, quanta)
                values[part] = self._answer(int(types[part]), b, quanta)
                self._insert(int(contact_key(types[part], b, quanta)), int(values[part]))
        return values

    def _learn(self, types: np.ndarray, rotations: np.ndarray, translations: np.ndarray, i: int, j: int) -> int:
        quanta = np.empty(12, dtype=np.int64)
        a, b = int(types[i]), int(types[j])
        reach = self.kit.types[b].diagonal / 2
        quantize_pose(rotations[i], translations[i], rotations[j], translations[j], reach, self._quantum, quanta)
        value = self._answer(a, b, quanta)
        self._insert(int(contact_key(a, b, quanta)), value)
        return value

    def _answer(self, a: int, b: int, quanta: np.ndarray) -> int:
        chosen = quanta if self._is_plain[a] and self._is_plain[b] else self._first_image(a, b, quanta)
        key = a.to_bytes(2, "little") + b.to_bytes(2, "little") + chosen.tobytes()
        if key not in self._of_geometry:
            self._of_geometry[key] = self._ask_geometry(a, b, self._pose(b, chosen))
        return self._of_geometry[key]

    def _first_image(self, a: int, b: int, quanta: np.ndarray) -> np.ndarray:
        """Return the image of a rounded pose with the smallest numbers, under the symmetries of both parts."""
        images = symmetric_images(self.kit.types[a], self.kit.types[b], self._pose(b, quanta))
        # The first numbers alone rule out most of the thousands of images of round parts.
        first = np.floor(images[:, 0, 3] / self._quantum + 0.5)
        images = images[first == first.min()]
        rounded = np.empty((len(images), 12), dtype=np.int64)
        rounded[:, :3] = np.floor(images[:, :3, 3] / self._quantum + 0.5)
        reach = self.kit.types[b].diagonal / 2
        rounded[:, 3:] = np.floor(images[:, :3, :3].reshape(-1, 9) * (reach / self._quantum) + 0.5)
        smallest: np.ndarray = rounded[np.lexsort(rounded.T[::-1])[0]]
        return smallest

    def _ask_geometry(self, a: int, b: int, pose: FloatArray) -> int:
        self.geometry_queries += 1
        if self.contact.touches(a, b, pose):
            label = int(self.dockings.label(a, b, pose[None])[0])
            back = int(self.dockings.label(b, a, invert(pose)[None])[0])
            # Seen from the smaller part a turn moves the larger one farther: within tolerance from one side alone.
            if label >= 0 and back >= 0:
                return label * LABEL_BASE + back
            fit = self.dockings.fit(a, b, pose)
            if fit is not None:
                allowed = self.kit.grammar.dockings[fit[0] // 2].depth + self.contact.tolerance
                return FORBIDDEN_CONTACT if self._is_deeper(a, b, pose, allowed) else fit[0] * LABEL_BASE + fit[1]
            # The kind of a contact takes long to find, most of all where large meshes pass through each other.
            if self._every_kind or self._nested(a, b, pose, apart=False):
                return FORBIDDEN_CONTACT
            return FORBIDDEN_CONTACT if self.contact.kind(a, b, pose) in self.kit.contact_kinds else NO_CONTACT
        if self.contact.touches(a, b, pose, BORDERLINE_TOLERANCES * self.contact.tolerance):
            return FORBIDDEN_CONTACT
        return FORBIDDEN_CONTACT if self._nested(a, b, pose, apart=True) else NO_CONTACT

    def _nested(self, a: int, b: int, pose: FloatArray, apart: bool) -> bool:
        """Return whether a part lies in the other deeper than any of their types did in the exemplars.

        apart: whether they do not touch
        """
        allowed = self.kit.grammar.nested.get((min(a, b), max(a, b)), 0.0) + self.contact.tolerance
        return self._is_deeper(a, b, pose, allowed, apart)

    def _is_deeper(self, a: int, b: int, pose: FloatArray, allowed: float, apart: bool = False) -> bool:
        """Return whether one part lies deeper in the other than is allowed; as `PenetrationTest.depth`."""
        first, second = self.kit.types[a].bounds, self.kit.types[b].bounds
        centre = pose[:3, :3] @ second.mean(axis=0) + pose[:3, 3]
        half = np.abs(pose[:3, :3]) @ (second[1] - second[0]) / 2
        if depth_bound(first, np.stack([centre - half, centre + half])) <= allowed:
            return False
        return self._penetration.depth(a, b, pose, apart) > allowed

    def _pose(self, b: int, quanta: np.ndarray) -> FloatArray:
        pose = np.eye(4)
        pose[:3, 3] = quanta[:3] * self._quantum
        pose[:3, :3] = quanta[3:].reshape(3, 3) * (self._quantum / (self.kit.types[b].diagonal / 2))
        return pose

    def _insert(self, key: int, value: int) -> None:
        if 2 * (self._size + 1) > len(self.table.keys):
            old = self.table
            self.table = _empty_table(2 * len(old.keys))
            self._size = 0
            for filled in np.flatnonzero(old.keys).tolist():
                self._insert(int(old.keys[filled]), int(old.values[filled]))
        mask = len(self.table.keys) - 1
        slot = key & mask
        while self.table.keys[slot] not in (0, key):
            slot = (slot + 1) & mask
        if self.table.keys[slot] == 0:
            self._size += 1
        self.table.keys[slot] = key
        self.table.values[slot] = value


def _empty_table(slots: int) -> ContactTable:
    return ContactTable(np.zeros(slots, dtype=np.uint64), np.zeros(slots, dtype=np.int64))
