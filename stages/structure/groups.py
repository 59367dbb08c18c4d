"""Groups of a shape: those that its source names and whose parts it has, and rows of congruent parts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.kit import PartGroup
from stages.shape.shape import Shape

GAP_SHARE = 1e-3
"""Largest distance of parts from where a group or a row has them, as a share of the diagonal of the shape."""
MAX_ROTATION_DIFFERENCE = 1e-3
"""Largest difference of two entries of rotations that count as equal."""
MIN_ROW_PARTS = 3
NEIGHBORS_TRIED = 8
"""Nearest congruent parts to which a step is tried."""
STEPS_PER_GAP = 8
"""Places are rounded to this share of the gap, so that the last digits of poses decide nothing."""


def named_groups(shape: Shape) -> list[tuple[str, frozenset[int]]]:
    """Return name and parts of the groups of its source that a shape has, larger ones first.

    A shape has a group where it has all of its parts at the same relative poses. Two groups are apart, or one is within
    the other. Equal groups of different names, such as `drawer_top` and `drawer_bottom`, have their common name.
    """
    whole = frozenset(range(len(shape)))
    found: dict[frozenset[int], list[str]] = {}
    places = _Places(shape)
    for group in shape.groups:
        for parts in places.of_group(group):
            if parts != whole and all(parts <= other or not parts & other for other in found):
                found.setdefault(parts, []).append(group.name)
    return [(_common_name(names), parts) for parts, names in found.items()]


def _common_name(names: Sequence[str]) -> str:
    """Return the words with which all names begin; the first name if they have none."""
    words = [re.split(r"([\s_.-]+)", name) for name in names]
    common = [of_all[0] for of_all in takewhile(lambda of_all: len(set(of_all)) == 1, zip(*words, strict=False))]
    return re.sub(r"[\s_.-]+$", "", "".join(common)) or names[0]


@dataclass(frozen=True)
class _Places:
    """Where the parts of a shape are."""

    shape: Shape

    @cached_property
    def gap(self) -> float:
        """Largest distance of two places that count as one."""
        points = np.concatenate([points for points, _ in self.surfaces])
        middles = np.repeat(
            [middle for _, middle in self.surfaces], [len(points) for points, _ in self.surfaces], axis=0
        )
        return GAP_SHARE * float(np.linalg.norm(np.ptp(points + middles, axis=0)))

    @cached_property
    def surfaces(self) -> list[tuple[FloatArray, FloatArray]]:
        """Vertices of each part about the middle of its box, float64 (v, 3), and the middle, float64 (3,)."""
        found = []
        for kind, pose in zip(self.shape.assembly.types.tolist(), self.shape.assembly.poses, strict=True):
            points = transform_points(pose, self.shape.meshes[kind].vertices)
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            found.append((points - middle, middle))
        return found

    def of_group(self, group: PartGroup) -> Iterator[frozenset[int]]:
        """Yield the sets of parts at the relative poses of a group."""
        # A type in another look is another mesh of the same vertices.
        surfaces = np.array([id(mesh.vertices) for mesh in self.shape.meshes])[self.shape.assembly.types]
        same = [np.flatnonzero(surfaces == id(part.vertices)) for part in group.parts]
        if min(map(len, same)) == 0:
            return
        anchor = min(range(len(same)), key=lambda part: len(same[part]) * len(group.parts[part].symmetries))
        from_anchor = invert(group.poses[anchor])
        for part in same[anchor].tolist():
            for symmetry in group.parts[anchor].symmetries:
                expected = self.shape.assembly.poses[part] @ symmetry @ from_anchor @ group.poses
                parts = self._parts_at(group, expected, same)
                if parts is not None:
                    yield parts

    def _parts_at(self, group: PartGroup, expected: FloatArray, same: Sequence[np.ndarray]) -> frozenset[int] | None:
        """Return the parts at the poses (k, 4, 4) of a group, up to symmetries of their types; None if one lacks."""
        poses, parts = self.shape.assembly.poses, set()
        for kind, pose, candidates in zip(group.parts, expected, same, strict=True):
            gaps = np.linalg.norm(poses[candidates, :3, 3] - pose[:3, 3], axis=1)
            turned = pose[:3, :3] @ kind.symmetries[:, :3, :3]
            for candidate in candidates[gaps <= self.gap].tolist():
                differences = np.abs(turned - poses[candidate, :3, :3]).max(axis=(1, 2))
                if candidate not in parts and differences.min() <= MAX_ROTATION_DIFFERENCE:
                    parts.add(candidate)
                    break
            else:
                return None
        return frozenset(parts)

    def congruent(self, parts: Sequence[int]) -> list[list[int]]:
        """Return the parts that are translates of each other, together."""
        classes: list[list[int]] = []
        for part in parts:
            known = next((one for one in classes if self._is_translate(one[0], part)), None)
            if known is None:
                classes.append([part])
            else:
                known.append(part)
        return classes

    def _is_translate(self, first: int, second: int) -> bool:
        from scipy.spatial import cKDTree

        labels = self.shape.part_labels
        (points, _), (others, _) = self.surfaces[first], self.surfaces[second]
        if labels[first] != labels[second] or len(points) != len(others):
            return False
        if np.abs(points.max(axis=0) - others.max(axis=0)).max() > self.gap:
            return False
        near = [cKDTree(one).query(other)[0].max() for one, other in ((points, others), (others, points))]
        return bool(max(near) <= self.gap)


def sibling_rows(shape: Shape, siblings: Sequence[Sequence[int]]) -> list[list[tuple[int, ...]]]:
    """Return the rows among the parts of each group: three or more translates at equal steps, along a line.

    Longer rows come first, of equally long ones those with the shorter step. A part is in one row.
    """
    places = _Places(shape)
    return [[row for alike in places.congruent(parts) for row in _rows_of(alike, places)] for parts in siblings]


def _rows_of(parts: Sequence[int], places: _Places) -> Iterator[tuple[int, ...]]:
    from scipy.spatial import cKDTree

    if len(parts) < MIN_ROW_PARTS:
        return
    unit = places.gap / STEPS_PER_GAP
    middles = np.rint(np.array([places.surfaces[part][1] for part in parts]) / unit) * unit
    tree = cKDTree(middles)
    nearest = tree.query(middles, k=min(len(parts), NEIGHBORS_TRIED + 1))[1]
    rows: dict[tuple[int, ...], float] = {}
    for start, others in enumerate(nearest.tolist()):
        for other in others:
            step = middles[other] - middles[start]
            if np.abs(step).max() > places.gap:
                row = (
                    *reversed(_following(tree, start, -step, places.gap)),
                    start,
                    *_following(tree, start, step, places.gap),
                )
                if len(row) >= MIN_ROW_PARTS:
                    rows[min(row, row[::-1])] = round(float(np.linalg.norm(step)) / places.gap)
    while rows:
        row = min(rows, key=lambda one: (-len(one), rows[one], one))
        yield tuple(sorted(parts[index] for index in row))
        taken, left = set(row), dict[tuple[int, ...], float]()
        for other, length in rows.items():
            for run in _runs(other, taken):
                left[run] = length
        rows = left


def _following(tree: Any, start: int, step: FloatArray, gap: float) -> list[int]:
    """Return the places that follow one at equal steps."""
    found: list[int] = []
    place = start
    while True:
        distance, following = tree.query(tree.data[place] + step)
        if distance > gap or following == place or following in found:
            return found
        place = int(following)
        found.append(place)


def _runs(row: Sequence[int], taken: set[int]) -> Iterator[tuple[int, ...]]:
    """Yield the runs of a row that are not taken and are rows."""
    run: list[int] = []
    for place in (*row, None):
        if place is not None and place not in taken:
            run.append(place)
            continue
        if len(run) >= MIN_ROW_PARTS:
            yield tuple(run)
        run = []
