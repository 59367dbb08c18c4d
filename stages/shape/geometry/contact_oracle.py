"""Contact answers by relative pose, computed from geometry once and then looked up."""

from __future__ import annotations

import copy
import ctypes
from typing import Any, get_args

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_lookup import contact_key, look_up_around, quantize_pose
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import invert
from stages.shape.kit import ContactKind, Kit
from stages.variations.kernels.structs import FORBIDDEN, LABELS, MISSING, NONE, ContactTable, Workspace
from stages.variations.kernels.tables import QUANTUM

BORDERLINE_TOLERANCES = 1.06
"""Parts closer than this many contact tolerances, yet not in contact, are too close to be called separate."""


class ContactOracle:
    """Answers how a part of one type at a relative pose touches a part of another.

    An answer is NONE (apart), FORBIDDEN (in contact in a way no exemplar shows, nested, or too close to call), or the
    two directed labels of the docking in one number. Poses are rounded to QUANTUM of the contact tolerance. Of all
    images of a pose under the symmetries of both parts one is chosen by its numbers alone, and the answer is that of
    the chosen pose. So an answer depends on the question and never on earlier questions.
    """

    def __init__(self, kit: Kit) -> None:
        self.kit = kit
        self.contact = ContactTest(kit.types, kit.contact_tolerance)
        self.dockings = DockingTable.of(kit)
        self.table = ContactTable(np.zeros(1 << 16, dtype=np.uint64), np.zeros(1 << 16, dtype=np.int64))
        self.geometry_queries = 0
        self._broken: BaseException | None = None
        self._size = 0
        self._penetration = PenetrationTest(kit.types)
        self._of_geometry: dict[bytes, int] = {}
        self._quantum = kit.contact_tolerance * QUANTUM
        self._every_kind = set(kit.contact_kinds) == set(get_args(ContactKind))

    def under(self, kit: Kit) -> ContactOracle:
        """Return a copy with all known answers for a kit that differs only in exemplars and admitted neighbourhoods."""
        other = copy.copy(self)
        other.kit = kit
        other.table = ContactTable(self.table.keys.copy(), self.table.values.copy())
        return other

    def answer_unknown(self, ws: Workspace, count: int) -> bool:
        """Answer the first `count` pairs of `ws.unknown`. Returns False at the first FORBIDDEN answer."""
        quanta = np.empty(12, dtype=np.int64)
        for i, j in ws.unknown[:count].tolist():
            a, b = int(ws.types[i]), int(ws.types[j])
            reach, quantum = self.kit.types[b].diagonal / 2, self._quantum
            quantize_pose(
                ws.rotations[i], ws.translations[i], ws.rotations[j], ws.translations[j], reach, quantum, quanta
            )
            value = self._answer(a, b, quanta)
            self._insert(int(contact_key(a, b, quanta)), value)
            if value == FORBIDDEN:
                return False
        return True

    def c_callback(self, types: np.ndarray, rotations: np.ndarray, translations: np.ndarray) -> Any:
        """Return a C function that answers, and caches, how two parts in these arrays touch, for kernels to call by
        address.

        types, rotations, translations: (n,), (n, 3, 3), (n, 3)

        Exceptions inside it are raised by `raise_pending`.
        """

        def answer(i: int, j: int) -> int:
            try:
                quanta = np.empty(12, dtype=np.int64)
                a, b = int(types[i]), int(types[j])
                reach, quantum = self.kit.types[b].diagonal / 2, self._quantum
                quantize_pose(rotations[i], translations[i], rotations[j], translations[j], reach, quantum, quanta)
                value = self._answer(a, b, quanta)
                self._insert(int(contact_key(a, b, quanta)), value)
                return value
            except BaseException as error:
                self._broken = error
                return FORBIDDEN

        return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(answer)

    def raise_pending(self) -> None:
        """Raise the exception that occurred in a C callback, through which no exception can pass."""
        if self._broken is not None:
            error, self._broken = self._broken, None
            raise error

    def around(self, types: np.ndarray, poses: FloatArray, b: int, pose: FloatArray) -> IntArray:
        """Return the answers, int64 (n,), for a part of type `b` at `pose` (4, 4) next to each of some parts.

        types, poses: the other parts, (n,) and (n, 4, 4)

        Geometry is not queried if a known answer is FORBIDDEN.
        """
        rotations, translations = np.ascontiguousarray(poses[:, :3, :3]), np.ascontiguousarray(poses[:, :3, 3])
        rotation, translation = np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3])
        reach, quantum = self.kit.types[b].diagonal / 2, self._quantum
        values = look_up_around(
            self.table.keys, self.table.values, types, rotations, translations, b, rotation, translation, reach, quantum
        )
        if not (values == FORBIDDEN).any():
            quanta = np.empty(12, dtype=np.int64)
            for part in np.flatnonzero(values == MISSING).tolist():
                quantize_pose(rotations[part], translations[part], rotation, translation, reach, quantum, quanta)
                values[part] = self._answer(int(types[part]), b, quanta)
                self._insert(int(contact_key(types[part], b, quanta)), int(values[part]))
        found: IntArray = values
        return found

    def _answer(self, a: int, b: int, quanta: np.ndarray) -> int:
        pose = self._pose(b, quanta)
        images = symmetric_images(self.kit.types[a], self.kit.types[b], pose)
        # The first numbers alone rule out most of the thousands of images of round parts.
        first = np.floor(images[:, 0, 3] / self._quantum + 0.5)
        images = images[first == first.min()]
        rounded = np.empty((len(images), 12), dtype=np.int64)
        rounded[:, :3] = np.floor(images[:, :3, 3] / self._quantum + 0.5)
        reach = self.kit.types[b].diagonal / 2
        rounded[:, 3:] = np.floor(images[:, :3, :3].reshape(-1, 9) * (reach / self._quantum) + 0.5)
        chosen = np.lexsort(rounded.T[::-1])[0]
        key = a.to_bytes(2, "little") + b.to_bytes(2, "little") + rounded[chosen].tobytes()
        if key not in self._of_geometry:
            self._of_geometry[key] = self._ask_geometry(a, b, self._pose(b, rounded[chosen]))
        return self._of_geometry[key]

    def _ask_geometry(self, a: int, b: int, pose: FloatArray) -> int:
        self.geometry_queries += 1
        touching = self.contact.touches(a, b, pose)
        if touching:
            label = int(self.dockings.label(a, b, pose[None])[0])
            back = int(self.dockings.label(b, a, invert(pose)[None])[0])
            # Seen from the smaller part a turn moves the larger one farther: within tolerance from one side alone.
            if label >= 0 and back >= 0:
                return label * LABELS + back
            fit = self.dockings.fit(a, b, pose)
            if fit is not None:
                allowed = self.kit.grammar.dockings[fit[0] // 2].depth + self.contact.tolerance
                return FORBIDDEN if self._is_deeper(a, b, pose, allowed) else fit[0] * LABELS + fit[1]
            # What touches does so in some kind, and which one is dear to tell.
            if self._every_kind or self.contact.kind(a, b, pose) in self.kit.contact_kinds:
                return FORBIDDEN
        elif self.contact.touches(a, b, pose, BORDERLINE_TOLERANCES * self.contact.tolerance):
            return FORBIDDEN
        return FORBIDDEN if self._nested(a, b, pose, not touching) else NONE

    def _nested(self, a: int, b: int, pose: FloatArray, apart: bool) -> bool:
        """Return whether a part lies in the other without a counted contact, deeper than observed for their types.

        apart: whether their surfaces are known not to touch
        """
        allowed = self.kit.grammar.nested.get((min(a, b), max(a, b)), 0.0) + self.contact.tolerance
        return self._is_deeper(a, b, pose, allowed, apart)

    def _is_deeper(self, a: int, b: int, pose: FloatArray, allowed: float, apart: bool = False) -> bool:
        """Return whether one of the parts lies deeper in the other than is allowed, as `PenetrationTest.depth`
        measures.
        """
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
            self.table = ContactTable(
                np.zeros(2 * len(old.keys), dtype=np.uint64), np.zeros(2 * len(old.keys), dtype=np.int64)
            )
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
