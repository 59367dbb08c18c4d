"""Verbatim copies: pieces of a shape that one rigid transform lays on an exemplar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import ShapeTables
from stages.variations.kernels.tables import shape_tables
from stages.variations.novelty.rigid_pieces import Dockings, Groups, Joints, Target, cover, locate, rigid_pieces

CONTACT_BUDGET = 2_000_000
"""Contacts looked at for one shape. Rare dockings come first, so beyond the budget only repetitions of common ones are
left out; `largest` may then be too small and `pieces` too large.
"""


@dataclass(frozen=True)
class CopiedPieces:
    """How much of a shape is a verbatim copy.

    A piece is a connected set of parts that lie so in one exemplar: one rigid transform, no reflection, lays each
    part on one that looks the same, and the contacts that connect the parts are contacts there too.

    largest: share of the shape's parts in its largest piece, 0 to 1
    pieces: number of pieces that cover the shape, chosen greedily
    exemplar: share of an exemplar's parts in the largest piece
    of: name of that exemplar; the smallest of several
    """

    largest: float
    pieces: int
    exemplar: float
    of: str

    def described(self) -> dict[str, Any]:
        """Return the same as JSON for a lineage."""
        return {
            "share": round(self.largest, 6),
            "pieces": self.pieces,
            "exemplar_share": round(self.exemplar, 6),
            "exemplar": self.of,
        }


class CopyDetector:
    """Measures how much assemblies of one kit copy from its exemplars."""

    def __init__(self, kit: Kit, dockings: DockingTable) -> None:
        self._names = tuple(exemplar.name for exemplar in kit.exemplars)
        self._types = len(kit.types)
        self._groups = _groups(kit)
        self._dockings = _dockings(kit, self._groups)
        self._target = self._exemplars(kit, dockings)
        self._has = np.array([np.isin(np.arange(self._types), exemplar.assembly.types) for exemplar in kit.exemplars])

    def copied(self, assembly: Assembly, labels: IntArray) -> CopiedPieces:
        """Return how much of `assembly` is copied.

        labels: int32 (m, 2), directed docking labels of its edges, as from `DockingTable.label_edges`; -1 where no
            exemplar shows the contact
        """
        shape = shape_tables(assembly, labels, self._types)
        parts, starts, owners = rigid_pieces(
            self._groups,
            self._dockings,
            shape.types,
            _handed(shape.rotations),
            _tails(shape),
            self._joints(shape),
            self._target,
            CONTACT_BUDGET,
        )
        sizes = np.diff(starts)
        if len(sizes):
            largest = int(sizes.max())
            showing = np.unique(owners[sizes == largest])
        else:
            largest = 1
            showing = np.flatnonzero(self._has[:, shape.types].any(axis=1))
        smallest = int(showing[self._target.sizes[showing].argmin()])
        share = largest / int(self._target.sizes[smallest])
        return CopiedPieces(
            largest / len(assembly), int(cover(parts, starts, len(assembly))), share, self._names[smallest]
        )

    def _joints(self, shape: ShapeTables) -> Joints:
        return Joints(shape.starts, shape.ends, shape.labels, *locate(self._groups, self._dockings, shape))

    def _exemplars(self, kit: Kit, table: DockingTable) -> Target:
        assemblies = [exemplar.assembly for exemplar in kit.exemplars]
        sizes = np.array([len(assembly) for assembly in assemblies])
        shifts = np.cumsum(sizes) - sizes
        whole = Assembly(
            np.concatenate([assembly.types for assembly in assemblies]),
            np.concatenate([assembly.poses for assembly in assemblies]),
            np.concatenate([assembly.edges + shift for assembly, shift in zip(assemblies, shifts, strict=True)]),
        )
        shape = shape_tables(whole, table.label_edges(whole.types, whole.poses, whole.edges), self._types)
        type_sizes = np.diff(shape.type_starts)
        rank = np.empty(len(whole), dtype=np.int64)
        rank[shape.by_type] = np.arange(len(whole)) - np.repeat(shape.type_starts[:-1], type_sizes)
        joints, tails = self._joints(shape), _tails(shape)
        groups, dockings = self._groups, self._dockings
        by_label = np.argsort(shape.labels, kind="stable")
        rooms = dockings.place_counts[shape.types]
        at_starts, at = np.cumsum(rooms) - rooms, np.full(rooms.sum(), -1, dtype=np.int32)
        # Contacts between two dockings, which are neither within tolerance, have no label and no spot.
        known = np.flatnonzero(joints.labels >= 0)
        place_numbers = dockings.place_numbers[dockings.rows[joints.labels[known]] + joints.near[known]]
        at[at_starts[tails[known]] + place_numbers] = known
        directed = np.arange(2 * len(kit.grammar.dockings) + 1)
        return Target(
            rank=rank,
            type_sizes=type_sizes,
            handed=_handed(shape.rotations),
            owner=np.repeat(np.arange(len(sizes)), sizes),
            sizes=sizes,
            joints=joints,
            undo_near=groups.inverses[groups.starts[shape.types[tails]] + joints.near],
            undo_far=groups.inverses[groups.starts[shape.types[shape.ends]] + joints.far],
            at=at,
            at_starts=at_starts,
            tails=tails,
            by_label=by_label,
            label_starts=np.searchsorted(shape.labels[by_label], directed),
        )


def _tails(shape: ShapeTables) -> np.ndarray:
    """Return the part that each contact of a shape is seen from, int64 (2 m,)."""
    return np.repeat(np.arange(len(shape.types)), np.diff(shape.starts))


def _handed(rotations: FloatArray) -> IntArray:
    """Return 1 for rotations (n, 3, 3), -1 for reflections, int64 (n,)."""
    handed: IntArray = np.where(np.linalg.det(rotations) < 0, -1, 1)
    return handed


def _groups(kit: Kit) -> Groups:
    rotations = [np.ascontiguousarray(part_type.symmetries[:, :3, :3]) for part_type in kit.types]
    orders = np.array([len(group) for group in rotations])
    inverses, products = [], []
    for group in rotations:
        table = np.full((len(group) + 1, len(group) + 1), len(group))
        table[:-1, :-1] = [_numbers(group, first @ group) for first in group]
        products.append(table.ravel())
        inverses.append(_numbers(group, np.swapaxes(group, 1, 2)))
    sizes = (orders + 1) ** 2
    return Groups(
        orders=orders,
        starts=np.cumsum(orders) - orders,
        rotations=np.concatenate(rotations),
        inverses=np.concatenate(inverses),
        signs=_handed(np.concatenate(rotations)),
        products=np.concatenate(products),
        rows=np.cumsum(sizes) - sizes,
        reach=np.array([part_type.diagonal / 2 for part_type in kit.types]),
    )


def _numbers(group: FloatArray, rotations: FloatArray) -> np.ndarray:
    """Return the number in a group (k, 3, 3) of each rotation (r, 3, 3), int64 (r,); k where the group lacks it.

    The symmetries of round parts are found by their corners and need not be complete.
    """
    apart = np.linalg.norm(group[1:] - group[0], axis=(1, 2)).min() / 2 if len(group) > 1 else np.inf
    gaps = np.linalg.norm(group[None] - rotations[:, None], axis=(2, 3))
    return np.where(gaps.min(axis=1) <= apart, gaps.argmin(axis=1), len(group))


def _dockings(kit: Kit, groups: Groups) -> Dockings:
    ends, poses = np.empty((0, 2), np.int64), np.empty((0, 4, 4))
    for docking in kit.grammar.dockings:
        ends = np.concatenate([ends, [(docking.a, docking.b), (docking.b, docking.a)]])
        poses = np.concatenate([poses, [docking.pose, invert(docking.pose)]])
    passed, kept, place_numbers = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    place_counts = np.zeros(len(kit.types), dtype=np.int64)
    # Two images of a docking are the same where one pose is within tolerance of both.
    within = 2 * kit.pose_tolerance
    for (a, b), pose in zip(ends.tolist(), poses, strict=True):
        first, other = kit.types[a].symmetries[:, :3, :3], kit.types[b].symmetries[:, :3, :3]
        turned = pose[:3, :3].T @ first @ pose[:3, :3]
        moved = np.linalg.norm(first @ pose[:3, 3] - pose[:3, 3], axis=1)
        gaps = np.linalg.norm(turned[:, None] - other[None], axis=(2, 3)) * groups.reach[b]
        same = np.hypot(moved, gaps.min(axis=1)) <= within
        passed.append(np.append(np.where(same, gaps.argmin(axis=1), len(other)), len(other)))
        kept.append(np.flatnonzero(same))
        side = len(first) + 1
        table = groups.products[groups.rows[a] :][: side**2].reshape(side, side)
        # Symmetries that differ by a kept one put the other part into one place.
        _, places = np.unique(table[:-1, kept[-1]].min(axis=1), return_inverse=True)
        place_numbers.append(np.append(place_counts[a] + places, -1))
        place_counts[a] += places.max() + 1
    lengths = groups.orders[ends[:, 0]] + 1
    joined_places = np.concatenate(place_numbers)
    # The last place around a type means nowhere.
    joined_places = np.where(joined_places < 0, place_counts[np.repeat(ends[:, 0], lengths)], joined_places)
    return Dockings(
        ends=ends,
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        translations=np.ascontiguousarray(poses[:, :3, 3]),
        passed=np.concatenate(passed),
        rows=np.cumsum(lengths) - lengths,
        kept=np.concatenate(kept),
        kept_starts=np.cumsum([len(symmetries) for symmetries in kept]),
        place_numbers=joined_places,
        place_counts=place_counts + 1,
        tolerance=kit.pose_tolerance,
    )
