"""Graded rows: like parts whose places and sizes change evenly, such as bars under an arched rail, or cushions of a
sofa.

Their sizes may differ, so that no translation leads from one to the next. Another number of them takes the same place:
each new part is the nearest old one, stretched to the box that curves through the old boxes give. Narrow parts with
wide gaps keep their widths; parts that fill their row become narrower or wider.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stages.rows.layout import Layout, sorted_edges, with_classes
from stages.rows.likeness import MAX_PARTS_COMPARED
from stages.rows.slabs import SlabError
from stages.rows.spanning import posed
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import relative_poses
from stages.shape.stretch import STRETCHED_DEPTH

MIN_GRADED_ROW = 3
NEAREST_PARTS = 6
"""Nearest parts of like size to which a first step from a part is tried."""
MAX_STEP_CHANGE = 0.2
"""Largest difference of two steps that follow each other, as a share of a step."""
MAX_SIZE_RATIO = 1.35
"""Largest ratio of the sides of two parts that follow each other."""
MAX_BEND_SHARE = 0.5
"""Largest change of the growth of sides, as a share of the step: two lids with a board between them are no row."""
MAX_PAIR_RATIO = 1.05
"""The same for a row of two."""
MAX_PAIR_GAP = 0.2
"""Largest gap, or overlap, of the parts of a row of two, as a share of their width."""
MAX_PAIR_SKEW = 0.05
"""Largest step of a row of two across its axis, as a share of the step."""
MAX_SHAPE_DIFFERENCE = 0.25
"""Largest distance of vertices of two parts that follow each other, once both fill a unit cube."""
MIN_ALIKE_SHARE = 0.95
"""Share of the vertices to which that applies."""
MIN_OUTER_GAP, MAX_OUTER_GAP = 0.75, 1.5
"""A part at such a distance from the end of a row, as a multiple of its gaps, bounds the row as one more part would."""
MIN_STEP_WIDTHS = 1.25
"""Shortest step between parts that keep their widths, in widths."""
MIN_GRADED_SHARE = 0.005
"""Share of the surface of a shape from which a graded row can be seen."""
MAX_STEP_DIFFERENCE = 0.05
"""Largest relative difference of the steps of rows that change together."""
MAX_DEPTH_RATIO = 2.0
"""How deep new parts may overlap others, as a multiple of how deep the old ones do."""
MIDDLE_SHARES = (0.4, 0.6)
"""The middle of a part, as shares of its length: what reaches over it holds the part not at its ends alone."""


@dataclass(frozen=True)
class Respacing:
    """Another number of parts in graded rows.

    rows: for each row its parts in the layout that changes, in order
    count: parts of each row afterwards
    """

    rows: tuple[tuple[int, ...], ...]
    count: int


@dataclass(frozen=True, eq=False)
class GradedRow:
    """Like parts at nearly equal steps.

    parts: in order, at least two
    holders: parts that all of them touch, int64 (k,) ascending
    """

    layout: Layout
    parts: tuple[int, ...]
    holders: np.ndarray

    @cached_property
    def centres(self) -> FloatArray:
        """Middles of the boxes of the parts, float64 (n, 3)."""
        middles: FloatArray = self.layout.boxes[list(self.parts)].mean(axis=1)
        return middles

    @cached_property
    def sides(self) -> FloatArray:
        """Sides of the boxes of the parts, float64 (n, 3)."""
        boxes = self.layout.boxes[list(self.parts)]
        sides: FloatArray = boxes[:, 1] - boxes[:, 0]
        return sides

    @cached_property
    def axis(self) -> int:
        """Index of the axis that the row follows most."""
        return int(np.abs(self.centres[-1] - self.centres[0]).argmax())

    @cached_property
    def step(self) -> float:
        """Mean step along the axis, in units."""
        return float(np.abs(np.diff(self.centres[:, self.axis])).mean())

    @cached_property
    def width(self) -> float:
        """Mean side of the parts along the axis, in units."""
        return float(self.sides[:, self.axis].mean())

    @property
    def fills(self) -> bool:
        """Whether gaps are narrower than parts, which then become narrower or wider."""
        return self.step - self.width < self.width

    def has_room_for(self, count: int) -> bool:
        """Return whether `count` parts fit: those that keep their widths need gaps, and one alone shows no row."""
        if self.fills:
            return True
        return count > 1 and self.places(count)[1] * self.step >= MIN_STEP_WIDTHS * self.width

    def places(self, count: int) -> tuple[FloatArray, float]:
        """Return the places of `count` parts, float64 (count,), 0 for the first old part and 1 for the next, and the
        new step in old ones.
        """
        old = len(self.parts)
        if self.fills:
            step, first = old / count, 0.5 * (old / count - 1.0)
        else:
            before, after = self._is_bounded(0), self._is_bounded(-1)
            step = (old - 1 + before + after) / (count - 1 + before + after)
            first = before * (step - 1.0)
        places: FloatArray = first + step * np.arange(count, dtype=np.float64)
        return places, step

    def _is_bounded(self, end: int) -> bool:
        """Return whether a part that is not of the row stands where the next part would be. end: 0 or -1"""
        layout, part = self.layout, self.parts[end]
        shift = self.centres[end] - self.centres[1 if end == 0 else -2]
        low, high = layout.boxes[part]
        swept_low, swept_high = np.minimum(low, low + shift * MAX_OUTER_GAP), np.maximum(high, high + shift)
        meets = (layout.boxes[:, 0] < swept_high).all(axis=1) & (layout.boxes[:, 1] > swept_low).all(axis=1)
        meets[[*self.parts, *layout.neighbours[part].tolist()]] = False
        if not meets.any():
            return False
        if shift[self.axis] > 0:
            gaps = layout.boxes[meets, 0, self.axis] - high[self.axis]
        else:
            gaps = low[self.axis] - layout.boxes[meets, 1, self.axis]
        share = float(gaps.min()) / (self.step - self.width)
        return MIN_OUTER_GAP <= share <= MAX_OUTER_GAP

    def boxes(self, count: int) -> tuple[np.ndarray, FloatArray, FloatArray]:
        """Return for each of `count` parts the old part that it is made of, int64 (count,), and the middle and sides of
        its box, float64 (count, 3) each.
        """
        from scipy.interpolate import CubicSpline, make_interp_spline

        places, step = self.places(count)
        knots, values = np.arange(len(self.parts)), np.hstack([self.centres, self.sides])
        curve = CubicSpline(knots, values) if len(knots) > 2 else make_interp_spline(knots, values, k=1)
        made = curve(places)
        nearest = np.clip(np.rint(places), 0, len(knots) - 1).astype(np.int64)
        centres, sides = made[:, :3], np.maximum(made[:, 3:], 0.5 * self.sides[nearest])
        if self.fills:
            sides[:, self.axis] *= step
        return np.array(self.parts)[nearest], centres, sides


def find_graded_rows(layout: Layout, changes_already: BoolArray) -> list[list[GradedRow]]:
    """Return the graded rows of a layout that can have more or fewer parts; those that change together in one list.

    changes_already: which parts other changes of rows repeat, bool (n,)
    """
    rows = [row for row in _rows(layout, changes_already) if _is_visible(row)]
    found: list[list[GradedRow]] = []
    while rows:
        peers = [row for row in rows if _are_peers(rows[0], row)]
        rows = [row for row in rows if row not in peers]
        count = len(peers[0].parts)
        if any(_is_valid(layout, peers, other) for other in (count + 1, count - 1)):
            found.append(peers)
    return found


def renumbered(row: Sequence[int], removed: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of a row's parts once other parts are removed."""
    return tuple((np.array(row) - np.searchsorted(np.sort(np.array(removed)), row)).tolist())


def respacing(peers: Sequence[GradedRow], count: int) -> Respacing:
    """Return the change of graded rows to `count` parts each."""
    return Respacing(tuple(row.parts for row in peers), count)


def respaced(layout: Layout, change: Respacing) -> Layout:
    """Return a layout with another number of parts in graded rows. Raises SlabError where that is not valid."""
    rows: list[GradedRow] = []
    for parts in change.rows:
        row = None if max(parts) >= len(layout) or len(set(parts)) < len(parts) else _row(layout, parts)
        if row is None or any(set(parts) & set(other.parts) for other in rows):
            raise SlabError("there is no such graded row")
        rows.append(row)
    return _respaced(layout, rows, change.count)


def _respaced(layout: Layout, rows: Sequence[GradedRow], count: int) -> Layout:
    """Return a layout with `count` parts in each of the rows, after all other parts. Raises SlabError."""
    if not rows or count < 1 or not all(row.has_room_for(count) for row in rows):
        raise SlabError("a graded row has no room for as many parts")
    removed = np.array([part for row in rows for part in row.parts])
    kept = np.setdiff1d(np.arange(len(layout)), removed)
    meshes, poses = [layout.meshes[part] for part in kept.tolist()], [layout.poses[kept]]
    sources = [kept]
    keys = [(kind, -1) for kind in layout.classes[kept].tolist()]
    for row in rows:
        nearest, centres, sides = row.boxes(count)
        sources.append(nearest)
        for number, part in enumerate(nearest.tolist()):
            low, high = layout.boxes[part]
            mesh, pose = layout.meshes[part], layout.poses[part].copy()
            if np.abs(high - low - sides[number]).max() <= layout.tolerance:
                pose[:3, 3] += np.round(centres[number] - (low + high) / 2, 12)
                keys.append((int(layout.classes[part]), -1))
            else:
                factors = sides[number] / np.maximum(high - low, 1e-12)
                points = centres[number] + (layout.points[part] - (low + high) / 2) * factors
                mesh, pose = posed(mesh, pose, points, mesh.faces, np.arange(len(mesh.faces)))
                keys.append((int(layout.classes[part]), len(keys)))
            meshes.append(mesh)
            poses.append(pose[None])
    chosen = np.concatenate(sources)
    made = replace(
        layout,
        meshes=tuple(meshes),
        poses=np.concatenate(poses),
        types=layout.types[chosen],
        origins=layout.origins[chosen],
    )
    return _with_contacts(layout, with_classes(made, keys), rows, kept, count)


def _with_contacts(layout: Layout, made: Layout, rows: Sequence[GradedRow], kept: np.ndarray, count: int) -> Layout:
    """Return a changed layout with its contacts. Raises SlabError where a part is not held, or clashes."""
    index_of = {part: number for number, part in enumerate(kept.tolist())}
    row_of = np.concatenate([np.full(len(kept), -1), np.repeat(np.arange(len(rows)), count)])
    near = [set(np.concatenate([layout.neighbours[part] for part in row.parts]).tolist()) for row in rows]
    may_touch: list[set[int]] = []
    for number, row in enumerate(rows):
        beside = [other for other, peer in enumerate(rows) if near[number] & set(peer.parts) and other != number]
        touched = {index_of[part] for part in near[number] if part in index_of}
        may_touch.append(touched | set(np.flatnonzero(np.isin(row_of, beside)).tolist()))
        if row.fills:
            may_touch[-1] |= set(np.flatnonzero(row_of == number).tolist())
    deepest = [_deepest(layout, row) for row in rows]
    touching = list(_touching(made, row_of, may_touch, deepest))
    held: list[set[int]] = [set() for _ in range(len(made))]
    for i, j in touching:
        held[i].add(j)
        held[j].add(i)
    for part in range(len(kept), len(made)):
        row = rows[row_of[part]]
        holders = [index_of.get(other, -1) for other in _end_holders(row).tolist()]  # -1: part of a row that changes
        if not (any if row.fills else all)(holder in held[part] for holder in holders):
            raise SlabError("a part of a graded row would not be held as the others are")
    edges = [(index_of[i], index_of[j]) for i, j in layout.edges.tolist() if i in index_of and j in index_of]
    made = replace(made, edges=sorted_edges([*edges, *touching]))
    if made.pieces().max() > layout.pieces().max():
        raise SlabError("a part would no longer be held")
    return made


def _touching(
    made: Layout, row_of: np.ndarray, may_touch: Sequence[set[int]], deepest: Sequence[float]
) -> Iterator[tuple[int, int]]:
    """Yield the contacts of the parts of graded rows. Raises SlabError where parts overlap more than they did.

    row_of: the row of each part, or -1, int64 (n,)
    may_touch: for each row the parts that its parts touched before
    deepest: for each row how deep its parts overlapped others before, in units
    """
    from stages.shape.geometry.contact import ContactTest, overlapping_boxes
    from stages.shape.geometry.penetration import PenetrationTest, depth_bound

    pairs = overlapping_boxes(made.boxes, made.tolerance)
    pairs = pairs[(row_of[pairs] >= 0).any(axis=1)]
    contact, penetration = ContactTest(made.meshes, made.tolerance), PenetrationTest(made.meshes)
    for (i, j), pose in zip(pairs.tolist(), relative_poses(made.poses, pairs), strict=True):
        if not contact.touches(i, j, pose):
            continue
        allowed = made.tolerance + STRETCHED_DEPTH * min(made.meshes[i].diagonal, made.meshes[j].diagonal)
        for part, other in ((i, j), (j, i)):
            if row_of[part] >= 0 and other in may_touch[row_of[part]]:
                allowed = max(allowed, MAX_DEPTH_RATIO * deepest[row_of[part]])
        if depth_bound(made.boxes[i], made.boxes[j]) > allowed and penetration.depth(i, j, pose) > allowed:
            raise SlabError("a part of a graded row would overlap another one")
        yield i, j


def _deepest(layout: Layout, row: GradedRow) -> float:
    """Return how deep a part of a row overlaps another one, at most, in units."""
    from stages.shape.geometry.penetration import PenetrationTest

    pairs = layout.edges[np.isin(layout.edges, row.parts).any(axis=1)]
    test = PenetrationTest(layout.meshes)
    poses = relative_poses(layout.poses, pairs)
    return max((test.depth(i, j, pose) for (i, j), pose in zip(pairs.tolist(), poses, strict=True)), default=0.0)


def _end_holders(row: GradedRow) -> np.ndarray:
    """Return which holders of a row do not reach over the middles of its parts, int64 (k,); all if none does so."""
    length = int(row.sides.max(axis=0).argmax())
    low, high = row.layout.boxes[list(row.parts)][:, :, length].T
    starts, ends = (low + share * (high - low) for share in MIDDLE_SHARES)
    boxes = row.layout.boxes[row.holders][:, :, length]
    over = (boxes[:, :1] <= starts) & (boxes[:, 1:] >= ends)
    at_ends = row.holders[~over.any(axis=1)]
    return at_ends if len(at_ends) else row.holders


def _is_valid(layout: Layout, rows: Sequence[GradedRow], count: int) -> bool:
    try:
        _respaced(layout, rows, count)
    except SlabError:
        return False
    return True


def _is_visible(row: GradedRow) -> bool:
    areas = row.layout.areas
    return float(areas[list(row.parts)].sum()) >= MIN_GRADED_SHARE * float(areas.sum())


def _are_peers(first: GradedRow, second: GradedRow) -> bool:
    """Return whether two rows of as many parts have steps of one length along one axis."""
    return (
        len(first.parts) == len(second.parts)
        and first.axis == second.axis
        and first.fills == second.fills
        and abs(first.step - second.step) <= MAX_STEP_DIFFERENCE * first.step
    )


def _rows(layout: Layout, changes_already: BoolArray) -> list[GradedRow]:
    """Return the graded rows of a layout, the longest first; no part is in two of them."""
    rows: list[GradedRow] = []
    taken: set[int] = set()
    chains = dict.fromkeys(_chains(layout, np.flatnonzero(~changes_already)))
    for parts in sorted(chains, key=lambda parts: (-len(parts), _length(layout, parts), parts)):
        row = None if taken & set(parts) else _row(layout, parts)
        if row is not None:
            rows.append(row)
            taken |= set(parts)
    return rows


def _length(layout: Layout, parts: Sequence[int]) -> float:
    middles = layout.boxes[list(parts)].mean(axis=1)
    return float(np.linalg.norm(np.diff(middles, axis=0), axis=1).sum())


def _chains(layout: Layout, members: np.ndarray) -> Iterator[tuple[int, ...]]:
    """Yield chains of parts of like sizes at nearly equal steps, each in the direction that starts with the lower part.

    members: parts that may be in chains, int64 (k,)
    """
    from scipy.spatial import cKDTree

    if not 1 < len(members) <= MAX_PARTS_COMPARED:
        return
    boxes = layout.boxes[members]
    middles, sides = boxes.mean(axis=1), np.maximum(boxes[:, 1] - boxes[:, 0], layout.tolerance)
    are_like = np.abs(np.log(sides[:, None] / sides[None])).max(axis=2) <= np.log(MAX_SIZE_RATIO)
    tree = cKDTree(middles)

    def extended(chain: list[int]) -> list[int]:
        while True:
            step = middles[chain[-1]] - middles[chain[-2]]
            near = tree.query_ball_point(middles[chain[-1]] + step, MAX_STEP_CHANGE * np.linalg.norm(step))
            found = [part for part in sorted(near) if are_like[chain[-1], part] and part not in chain]
            if not found:
                return chain
            gaps = np.linalg.norm(middles[found] - middles[chain[-1]] - step, axis=1)
            chain.append(found[int(gaps.argmin())])

    for first in range(len(members)):
        others = np.flatnonzero(are_like[first])
        others = others[others != first]
        gaps = np.linalg.norm(middles[others] - middles[first], axis=1)
        for second in others[np.argsort(gaps, kind="stable")[:NEAREST_PARTS]].tolist():
            if gaps.min() > 0:
                chain = members[extended(extended([first, second])[::-1])].tolist()
                yield min(tuple(chain), tuple(chain[::-1]))


def _row(layout: Layout, parts: Sequence[int]) -> GradedRow | None:
    """Return parts as a graded row, or None if they make none."""
    if len(parts) < 2:
        return None
    members = list(parts)
    holders = set(layout.neighbours[members[0]].tolist())
    for part in members[1:]:
        holders &= set(layout.neighbours[part].tolist())
    row = GradedRow(layout, tuple(parts), np.array(sorted(holders - set(parts)), dtype=np.int64))
    if not len(row.holders) or not row.step > 0 or not _has_even_steps(row) or not _are_alike(layout, members):
        return None
    if not row.fills and np.isin(layout.edges, members).all(axis=1).any():
        return None
    return row


def _has_even_steps(row: GradedRow) -> bool:
    """Return whether steps and sides change evenly from part to part; those of two parts must be equal and close."""
    steps = np.diff(row.centres, axis=0)
    if len(row.parts) >= MIN_GRADED_ROW:
        changes, lengths = np.linalg.norm(np.diff(steps, axis=0), axis=1), np.linalg.norm(steps[1:], axis=1)
        bends = np.abs(np.diff(row.sides, n=2, axis=0)).max(axis=1)
        return bool((changes <= MAX_STEP_CHANGE * lengths).all() and (bends <= MAX_BEND_SHARE * lengths).all())
    ratios = row.sides[1] / np.maximum(row.sides[0], row.layout.tolerance)
    is_equal = bool((ratios <= MAX_PAIR_RATIO).all() and (ratios >= 1.0 / MAX_PAIR_RATIO).all())
    across = np.abs(np.delete(steps[0], row.axis)).max()
    is_close = abs(row.step - row.width) <= MAX_PAIR_GAP * row.width
    return is_equal and is_close and bool(across <= MAX_PAIR_SKEW * row.step)


def _are_alike(layout: Layout, parts: Sequence[int]) -> bool:
    """Return whether parts that follow each other look the same once their boxes are stretched to a unit cube."""
    from scipy.spatial import cKDTree

    cubes = []
    for part in parts:
        low, high = layout.boxes[part]
        cubes.append((layout.points[part] - low) / np.maximum(high - low, layout.tolerance))
    trees = [cKDTree(cube) for cube in cubes]
    for number in range(len(parts) - 1):
        there, _ = trees[number].query(cubes[number + 1])
        back, _ = trees[number + 1].query(cubes[number])
        if min((gaps <= MAX_SHAPE_DIFFERENCE).mean() for gaps in (there, back)) < MIN_ALIKE_SHARE:
            return False
    return True
