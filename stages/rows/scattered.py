"""Scattered parts: like parts that another one holds in no order, such as leaves of a plant, or apples in a bowl.

Some are left out, or copies are added. A copy is an old part turned about the vertical axis through the middle of what
holds it, with all that hangs on it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stages.rows.layout import Layout, sorted_edges, with_classes
from stages.rows.likeness import MAX_PARTS_COMPARED, have_like_shapes, have_like_sizes, principal_axes
from stages.rows.slabs import SlabError
from stages.rows.turns import rotation_about
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import relative_poses, transform_points
from stages.shape.stretch import STRETCHED_DEPTH

if TYPE_CHECKING:
    from stages.shape.geometry.contact import ContactTest
    from stages.shape.geometry.penetration import PenetrationTest

MIN_SCATTERED = 3
MIN_SCATTERED_SHARE, MAX_MEMBER_SHARE = 0.02, 0.25
"""Smallest share of the surface of a shape that scattered parts have together, and largest of one of them."""
MIN_LENGTH_SHARE, MAX_LENGTH_SHARE = 0.06, 0.45
"""Smallest and largest diagonal of the box around a scattered part, as shares of the shape's: leaves of a bush are not
counted, and seats of a sofa do not lie about.
"""
MIN_INLAID_SHARE = 0.7
"""Share of both larger extents of a part along which its holder touches it, from which it lies in the surface of that:
without a panel a football has a hole.
"""
MAX_REGULAR_SHARE = 0.5
"""Share of parts that are turned alike, or mirror images of others, up to which all are scattered: legs are not."""
MIN_ALIGNED_COSINE = 0.998
"""Cosine of the angle of two principal axes from which they are parallel."""
MIN_AXIS_DIFFERENCE = 0.15
"""Relative difference of the sizes along two principal axes from which these axes are distinct."""
MAX_MIRROR_DIFFERENCE = 0.08
"""Largest distance of a mirrored box from that of another part, as a share of its diagonal."""
MIN_STANDING_HEIGHT = 0.8
"""A part stands on what holds it if its bottom is at this share of the height of that, or higher."""
CENTRE_DECIMALS = 9
FULL_TURN_DEGREES = 360
TURN_STEP_DEGREES, MIN_TURN_STEPS = 15, 2
"""Copies are turned by multiples of this angle, and at least by two of it, so that most tests are made once."""
TRIES_PER_COPY = 8


class TurnedCopy(NamedTuple):
    """A scattered part that is added.

    part: the old one
    degrees: angle by which the copy is turned about the vertical axis, 1 to 359
    """

    part: int
    degrees: int


class CrossContact(NamedTuple):
    """A contact of two parts of different layouts."""

    part: int  # of the first
    other: int  # of the second
    is_too_deep: bool  # whether they overlap deeper than is allowed


@dataclass(frozen=True)
class Scattering:
    """Another number of scattered parts.

    parts: those that are scattered in the layout that changes, ascending, without what hangs on them
    up: index of the axis that points up
    removed: those of them that are left out, ascending
    copies: those that are added, in order
    """

    parts: tuple[int, ...]
    up: int
    removed: tuple[int, ...] = ()
    copies: tuple[TurnedCopy, ...] = ()

    @property
    def count(self) -> int:
        """Number of scattered parts afterwards."""
        return len(self.parts) - len(self.removed) + len(self.copies)


@dataclass(frozen=True, eq=False)
class ScatteredParts:
    """Like parts that can be left out one by one, each with what hangs on it alone.

    members: parts of each, the one that is held first
    holders: other parts that hold them, int64 (k,) ascending
    up: index of the axis that points up
    """

    layout: Layout
    members: tuple[tuple[int, ...], ...]
    holders: np.ndarray
    up: int

    @property
    def parts(self) -> tuple[int, ...]:
        """The part of each member that is held, ascending."""
        return tuple(member[0] for member in self.members)

    def holder(self, part: int) -> int:
        """Return the largest of the holders that one of the parts touches, or -1 if it lies on others of them alone."""
        holders = np.intersect1d(self.layout.neighbours[part], self.holders)
        return int(holders[self.layout.areas[holders].argmax()]) if len(holders) else -1

    @cached_property
    def is_held(self) -> BoolArray:
        """Whether each member touches a holder, and not others of them alone, bool (n,)."""
        return np.array([self.holder(part) >= 0 for part in self.parts])

    @cached_property
    def deepest(self) -> float:
        """How deep a member overlaps another part, at most, in units."""
        layout, is_member = self.layout, np.zeros(len(self.layout), dtype=np.int64)
        for number, member in enumerate(self.members, start=1):
            is_member[list(member)] = number
        pairs = layout.edges[is_member[layout.edges[:, 0]] != is_member[layout.edges[:, 1]]]
        posed = zip(pairs.tolist(), relative_poses(layout.poses, pairs), strict=True)
        return max((self._penetration.depth(i, j, pose) for (i, j), pose in posed), default=0.0)

    def placed(self, copy: TurnedCopy) -> Layout:
        """Return the parts of a copy, with the contacts among them."""
        if copy not in self._placed:
            layout, member = self.layout, np.array(self._member_of[copy.part])
            middle = layout.boxes[self.holder(copy.part)].mean(axis=0)
            rotation = rotation_about(self.up, np.round(middle, CENTRE_DECIMALS), np.deg2rad(copy.degrees))
            edges = layout.edges[np.isin(layout.edges, member).all(axis=1)]
            order = np.argsort(member)
            self._placed[copy] = replace(
                layout,
                meshes=tuple(layout.meshes[part] for part in member.tolist()),
                poses=rotation @ layout.poses[member],
                types=layout.types[member],
                classes=layout.classes[member],
                origins=layout.origins[member],
                edges=sorted_edges(order[np.searchsorted(member[order], edges)]),
            )
        return self._placed[copy]

    def contacts(self, copy: TurnedCopy, removed: Collection[int] = ()) -> list[tuple[int, int]]:
        """Return the contacts of a copy with the layout, each a part of the layout and one of the copy.

        removed: scattered parts that will be left out, and may be overlapped
        Raises SlabError where the copy does not touch what holds the old part, where it reaches beyond that while the
        old part does not, or where it overlaps another part deeper than those before.
        """
        if copy not in self._contacts:
            self._contacts[copy] = self._found_contacts(copy)
        found = self._contacts[copy]
        if isinstance(found, str):
            raise SlabError(found)
        left_out = {part for member in self.members if member[0] in removed for part in member}
        if any(contact.is_too_deep and contact.part not in left_out for contact in found):
            raise SlabError("a copy of a scattered part would overlap another part")
        return [(contact.part, contact.other) for contact in found]

    def _found_contacts(self, copy: TurnedCopy) -> list[CrossContact] | str:
        """Return the contacts of a copy with the layout, or why it has no place."""
        holder, placed = self.holder(copy.part), self.placed(copy)
        if holder < 0:
            return "a scattered part that lies on others is not copied"
        across = [axis for axis in range(3) if axis != self.up]
        sides = self.layout.boxes[holder][:, across]
        beyond_before = _beyond(sides, self.layout.boxes[list(self._member_of[copy.part])][:, :, across])
        if _beyond(sides, placed.boxes[:, :, across]) > beyond_before + self.layout.tolerance:
            return "a copy of a scattered part would reach beyond what holds it"
        may_overlap = np.zeros(len(self.layout), dtype=np.bool_)
        may_overlap[self.holders] = may_overlap[[part for member in self.members for part in member]] = True
        found = self._cross_contacts(self.layout, placed, np.where(may_overlap, self.deepest, 0.0))
        is_held = any(contact.part == holder and contact.other == 0 for contact in found)
        return found if is_held else "a copy of a scattered part would not be held"

    def contacts_between(self, first: TurnedCopy, second: TurnedCopy) -> list[tuple[int, int]]:
        """Return the contacts of two copies, each a part of either. Raises SlabError where they overlap too deep."""
        if (first, second) not in self._between:
            placed = self.placed(first)
            allowed = np.full(len(placed), self.deepest)
            self._between[first, second] = self._cross_contacts(placed, self.placed(second), allowed)
        found = self._between[first, second]
        if first == second or any(contact.is_too_deep for contact in found):
            raise SlabError("two copies of scattered parts would overlap")
        return [(contact.part, contact.other) for contact in found]

    def _cross_contacts(self, first: Layout, second: Layout, deepest: FloatArray) -> list[CrossContact]:
        """Return the contacts between two layouts of parts of this one.

        deepest: how deep each part of the first may overlap others, in units, float64 (n,); little is always allowed
        """
        from stages.shape.geometry.penetration import depth_bound

        tolerance = self.layout.tolerance
        is_near = (first.boxes[:, None, 0] <= second.boxes[None, :, 1] + tolerance).all(axis=2)
        is_near &= (second.boxes[None, :, 0] <= first.boxes[:, None, 1] + tolerance).all(axis=2)
        pairs = np.argwhere(is_near)
        poses = relative_poses(np.concatenate([first.poses, second.poses]), pairs + np.array([0, len(first)]))
        found: list[CrossContact] = []
        for (i, j), pose in zip(pairs.tolist(), poses, strict=True):
            one, other = self._mesh_numbers[id(first.meshes[i])], self._mesh_numbers[id(second.meshes[j])]
            if not self.contact_test.touches(one, other, pose):
                continue
            little = tolerance + STRETCHED_DEPTH * min(first.meshes[i].diagonal, second.meshes[j].diagonal)
            allowed = max(little, float(deepest[i]))
            is_deep = depth_bound(first.boxes[i], second.boxes[j]) > allowed
            found.append(CrossContact(i, j, is_deep and self._penetration.depth(one, other, pose) > allowed))
        return found

    @cached_property
    def _mesh_numbers(self) -> dict[int, int]:
        """A part with each surface, by the identity of the surface."""
        return {id(mesh): part for part, mesh in enumerate(self.layout.meshes)}

    @cached_property
    def contact_test(self) -> ContactTest:
        """The test of contacts of the parts of the layout, by their numbers."""
        from stages.shape.geometry.contact import ContactTest

        return ContactTest(self.layout.meshes, self.layout.tolerance)

    @cached_property
    def _penetration(self) -> PenetrationTest:
        from stages.shape.geometry.penetration import PenetrationTest

        return PenetrationTest(self.layout.meshes)

    @cached_property
    def _member_of(self) -> dict[int, tuple[int, ...]]:
        return {member[0]: member for member in self.members}

    @cached_property
    def _placed(self) -> dict[TurnedCopy, Layout]:
        return {}

    @cached_property
    def _contacts(self) -> dict[TurnedCopy, list[CrossContact] | str]:
        return {}

    @cached_property
    def _between(self) -> dict[tuple[TurnedCopy, TurnedCopy], list[CrossContact]]:
        return {}

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Scattering, Layout] | None:
        """Return a change to about `count` parts and the layout that it makes, or None where none is possible.

        At least half of the old parts stay, if as many are asked for. Parts that lie on others are left out before
        these. There are fewer parts than asked for where copies find no place.
        """
        parts = np.array(self.parts)
        most = min(count, len(parts))
        stay = int(rng.integers(-(-most // 2), most + 1))
        order = rng.permutation(len(parts))
        removed = self._removable(parts[order[np.argsort(self.is_held[order], kind="stable")]], len(parts) - stay)
        held, copies = parts[self.is_held].tolist(), list[TurnedCopy]()
        for _ in range(count - len(parts) + len(removed)):
            for _ in range(TRIES_PER_COPY):
                steps = int(rng.integers(MIN_TURN_STEPS, FULL_TURN_DEGREES // TURN_STEP_DEGREES - MIN_TURN_STEPS + 1))
                copy = TurnedCopy(held[int(rng.integers(len(held)))], TURN_STEP_DEGREES * steps)
                if self._fits(copy, copies, removed):
                    copies.append(copy)
                    break
        if not (removed or copies):
            return None
        change = Scattering(self.parts, self.up, tuple(sorted(removed)), tuple(copies))
        return change, _rescattered(self, change)

    def _removable(self, order: np.ndarray, count: int) -> list[int]:
        """Return up to `count` parts, the first in some order that can be left out together."""
        removed: list[int] = []
        for part in order.tolist():
            if len(removed) < count:
                with suppress(SlabError):
                    _without(self, self.layout, [*removed, part])
                    removed.append(part)
        return removed

    def _fits(self, copy: TurnedCopy, others: Sequence[TurnedCopy], removed: Collection[int]) -> bool:
        try:
            self.contacts(copy, removed)
            for other in others:
                self.contacts_between(other, copy)
        except SlabError:
            return False
        return True


def find_scattered_parts(layout: Layout, up: int, changes_already: BoolArray) -> list[ScatteredParts]:
    """Return the sets of scattered parts of a layout, the largest first; no part is in two of them.

    up: index of the axis that points up
    changes_already: which parts other changes repeat, bool (n,)
    """
    if not MIN_SCATTERED < len(layout) <= MAX_PARTS_COMPARED or layout.pieces().max() > 0:
        return []
    clusters: list[list[tuple[int, ...]]] = []
    sizes: list[FloatArray] = []
    for member in _members(layout, np.flatnonzero(~changes_already)):
        size = principal_axes(layout.points[member[0]])[0]
        alike = (number for number in range(len(clusters)) if have_like_sizes(sizes[number], size))
        number = next(alike, len(clusters))
        if number == len(clusters):
            clusters.append([])
            sizes.append(size)
        clusters[number].append(member)
    found: list[ScatteredParts] = []
    taken: set[int] = set()
    for cluster in sorted(clusters, key=lambda cluster: -_area(layout, cluster)):
        for group in (cluster, *_alike_groups(layout, cluster)):
            scattered = _scattered_parts(layout, group, up)
            inner = set() if scattered is None else {part for member in scattered.members for part in member}
            if scattered is not None and taken.isdisjoint(inner):
                found.append(scattered)
                taken |= inner
    return found


def _alike_groups(layout: Layout, cluster: Sequence[tuple[int, ...]]) -> list[list[tuple[int, ...]]]:
    """Return the groups of members of one shape, such as the leaves of one kind, the first member's first."""
    groups: list[list[tuple[int, ...]]] = []
    for member in cluster:
        group = next((group for group in groups if _are_alike(layout, group[0][0], member[0])), None)
        if group is None:
            groups.append([member])
        else:
            group.append(member)
    return groups


def rescattered(layout: Layout, change: Scattering) -> Layout:
    """Return a layout with another number of scattered parts. Raises SlabError where that is not valid."""
    parts, named = np.array(change.parts), {*change.removed, *(copy.part for copy in change.copies)}
    are_distinct = all(len(set(numbers)) == len(numbers) for numbers in (change.parts, change.removed))
    if parts.max() >= len(layout) or not are_distinct or not named <= {*change.parts}:
        raise SlabError("there are no such scattered parts")
    scattered = _scattered_parts(layout, _members(layout, parts), change.up)
    if scattered is None or scattered.parts != change.parts:
        raise SlabError("parts are not scattered")
    return _rescattered(scattered, change)


def _rescattered(scattered: ScatteredParts, change: Scattering) -> Layout:
    return _without(scattered, _with_copies(scattered, change), change.removed)


def _without(scattered: ScatteredParts, layout: Layout, removed: Collection[int]) -> Layout:
    """Return a layout without some of the scattered parts. Raises SlabError where others lose their hold.

    layout: that of the scattered parts, also with copies after its other parts
    """
    left_out = [part for member in scattered.members if member[0] in removed for part in member]
    kept = np.setdiff1d(np.arange(len(layout)), left_out)
    index_of = np.full(len(layout), -1)
    index_of[kept] = np.arange(len(kept))
    edges = index_of[layout.edges]
    made = replace(
        layout,
        meshes=tuple(layout.meshes[part] for part in kept.tolist()),
        poses=layout.poses[kept],
        types=layout.types[kept],
        classes=layout.classes[kept],
        origins=layout.origins[kept],
        edges=sorted_edges(edges[(edges >= 0).all(axis=1)]),
    )
    if made.pieces().max() > layout.pieces().max():
        raise SlabError("a part would no longer be held")
    return made


def _with_copies(scattered: ScatteredParts, change: Scattering) -> Layout:
    """Return a layout with the copies of a change after all its parts. Raises SlabError where one has no place."""
    layout, copies = scattered.layout, change.copies
    placed = [scattered.placed(copy) for copy in copies]
    starts = [len(layout), *(len(layout) + np.cumsum([len(parts) for parts in placed], dtype=np.int64)).tolist()]
    edges = layout.edges.tolist()
    for number, copy in enumerate(copies):
        own = starts[number]
        edges += [(own + i, own + j) for i, j in placed[number].edges.tolist()]
        edges += [(i, own + j) for i, j in scattered.contacts(copy, change.removed)]
        for other in range(number):
            edges += [(starts[other] + i, own + j) for i, j in scattered.contacts_between(copies[other], copy)]
    keys = [(kind, 0) for kind in layout.classes.tolist()]
    for copy, parts in zip(copies, placed, strict=True):
        keys += [(kind, copy.degrees) for kind in parts.classes.tolist()]
    made = replace(
        layout,
        meshes=(*layout.meshes, *(mesh for parts in placed for mesh in parts.meshes)),
        poses=np.concatenate([layout.poses, *(parts.poses for parts in placed)]),
        types=np.concatenate([layout.types, *(parts.types for parts in placed)]),
        origins=np.concatenate([layout.origins, *(parts.origins for parts in placed)]),
        edges=sorted_edges(edges),
    )
    return with_classes(made, keys)


def _beyond(sides: FloatArray, boxes: FloatArray) -> float:
    """Return how far some boxes, float64 (k, 2, 2), reach beyond the sides (2, 2) of another one, in units."""
    return max(float((sides[0] - boxes[:, 0]).max()), float((boxes[:, 1] - sides[1]).max()), 0.0)


def _members(layout: Layout, parts: np.ndarray) -> list[tuple[int, ...]]:
    """Return of some parts those that can be seen and left out, each followed by what hangs on it alone.

    parts: int64 (k,) ascending
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    areas, core = layout.areas, int(layout.areas.argmax())
    i, j = layout.edges[:, 0], layout.edges[:, 1]
    members: list[tuple[int, ...]] = []
    lengths = np.linalg.norm(layout.boxes[:, 1] - layout.boxes[:, 0], axis=1)
    shares = lengths / float(np.linalg.norm(layout.extent))
    fits = (shares >= MIN_LENGTH_SHARE) & (shares <= MAX_LENGTH_SHARE)
    for part in parts[fits[parts]].tolist():
        kept = (i != part) & (j != part)
        graph = coo_matrix((np.ones(int(kept.sum())), (i[kept], j[kept])), shape=(len(layout), len(layout)))
        pieces = connected_components(graph, directed=False)[1]
        hung = np.flatnonzero(pieces != pieces[core])
        if part != core and areas[hung].sum() <= MAX_MEMBER_SHARE * areas.sum():
            members.append((part, *(other for other in hung.tolist() if other != part)))
    return members


def _scattered_parts(layout: Layout, members: Sequence[tuple[int, ...]], up: int) -> ScatteredParts | None:
    """Return like parts as scattered ones, or None if they make none.

    Left out are those that hang on others of them, and those on which anything else lies.
    """
    hung = {part for member in members for part in member[1:]}
    members = _without_burdened(layout, [member for member in members if member[0] not in hung])
    if len(members) < MIN_SCATTERED or _area(layout, members) < MIN_SCATTERED_SHARE * float(layout.areas.sum()):
        return None
    inner = [part for member in members for part in member]
    touched = np.unique(np.concatenate([layout.neighbours[member[0]] for member in members]))
    scattered = ScatteredParts(layout, tuple(members), np.setdiff1d(touched, inner), up)
    if not len(scattered.holders) or not scattered.is_held.any():
        return None
    sizes = [principal_axes(layout.points[member[0]])[0] for member in members]
    if not all(have_like_sizes(sizes[0], size) for size in sizes[1:]):
        return None
    most = MAX_REGULAR_SHARE * len(members)
    if _mirrored(layout, members, up).sum() > most:
        return None
    if _stand(scattered):
        return scattered
    if any(_is_inlaid(scattered, part) for part in scattered.parts):
        return None
    first, *others = (member[0] for member in members)
    if _aligned(layout, members).sum() > most or not all(_are_alike(layout, first, other) for other in others):
        return None
    return scattered


def _without_burdened(layout: Layout, members: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return those of some members on which nothing lies but what hangs on them, and other members.

    A part lies on a member that it touches if it is further from the largest part: fruits lie in a bowl next to each
    other, spines of a cactus lie on its columns, also where they touch several.
    """
    levels = _levels(layout)
    left = list(members)
    while True:
        inner = {part for member in left for part in member}
        free = [
            member
            for member in left
            if all(
                other in inner or levels[other] <= levels[member[0]]
                for part in member
                for other in layout.neighbours[part].tolist()
            )
        ]
        if len(free) == len(left):
            return free
        left = free


def _levels(layout: Layout) -> np.ndarray:
    """Return the smallest number of contacts that lead from each part to that with the largest area, int64 (n,)."""
    levels = np.full(len(layout), len(layout), dtype=np.int64)
    level, reached = 0, np.array([int(layout.areas.argmax())])
    while len(reached):
        levels[reached] = level
        touched = np.unique(np.concatenate([layout.neighbours[part] for part in reached.tolist()]))
        level, reached = level + 1, touched[levels[touched] > level]
    return levels


def _are_alike(layout: Layout, first: int, second: int) -> bool:
    """Return whether two parts are congruent or have like shapes: the hands of a figure are no leaves."""
    return layout.meshes[first] is layout.meshes[second] or have_like_shapes(
        layout.points[first], layout.points[second]
    )


def _is_inlaid(scattered: ScatteredParts, part: int) -> bool:
    """Return whether the holder of a part touches it along most of its length and width."""
    layout, holder = scattered.layout, scattered.holder(part)
    if holder < 0:
        return False
    (pose,) = relative_poses(layout.poses, np.array([[holder, part]]))
    touching = transform_points(layout.poses[holder], scattered.contact_test.area(holder, part, pose))
    if not len(touching):
        return False
    axes = principal_axes(layout.points[part])[1][:, 1:]
    extents = np.ptp(layout.points[part] @ axes, axis=0)
    return bool((np.ptp(touching @ axes, axis=0) >= MIN_INLAID_SHARE * extents).all())


def _stand(scattered: ScatteredParts) -> bool:
    """Return whether each part stands on one of its holders."""
    layout, up = scattered.layout, scattered.up
    lows, highs = layout.boxes[:, 0, up], layout.boxes[:, 1, up]
    for part in np.array(scattered.parts)[scattered.is_held].tolist():
        holders = np.intersect1d(layout.neighbours[part], scattered.holders)
        levels = lows[holders] + MIN_STANDING_HEIGHT * (highs - lows)[holders]
        if not (lows[part] >= levels).any():
            return False
    return True


def _aligned(layout: Layout, members: Sequence[tuple[int, ...]]) -> BoolArray:
    """Return which members are turned as another one is, bool (n,); round ones whose turn nobody sees are."""
    parts = [member[0] for member in members]
    principal = [principal_axes(layout.points[part]) for part in parts]
    low, middle, high = np.array([sizes for sizes, _ in principal]).T
    gaps = np.stack([middle - low, np.minimum(middle - low, high - middle), high - middle], axis=1)
    is_distinct = gaps > MIN_AXIS_DIFFERENCE * high[:, None]
    axes = np.stack([columns for _, columns in principal])
    is_parallel = np.abs(np.einsum("iak,jak->ijk", axes, axes)) >= MIN_ALIGNED_COSINE
    meshes, classes = np.array([id(layout.meshes[part]) for part in parts]), layout.classes[parts]
    is_aligned = np.where(
        meshes[:, None] == meshes, classes[:, None] == classes, (is_parallel | ~is_distinct[:, None]).all(axis=2)
    )
    np.fill_diagonal(is_aligned, val=False)
    found: BoolArray = is_aligned.any(axis=1)
    return found


def _mirrored(layout: Layout, members: Sequence[tuple[int, ...]], up: int) -> BoolArray:
    """Return which members are mirror images of themselves or others in an upright plane, bool (n,).

    The planes are those through the middle of all members and of the shape, across the axes that do not point up.
    """
    boxes = np.stack([_box(layout, member) for member in members])
    reach = MAX_MIRROR_DIFFERENCE * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    found = np.zeros(len(members), dtype=np.bool_)
    for axis in (axis for axis in range(3) if axis != up):
        for all_boxes in (boxes, layout.boxes):
            total = all_boxes[:, 0, axis].min() + all_boxes[:, 1, axis].max()
            mirrored = boxes.copy()
            mirrored[:, 0, axis], mirrored[:, 1, axis] = total - boxes[:, 1, axis], total - boxes[:, 0, axis]
            gaps = np.abs(mirrored[:, None] - boxes[None]).max(axis=(2, 3))
            found |= (gaps <= reach[:, None]).any(axis=1)
    return found


def _box(layout: Layout, member: Sequence[int]) -> FloatArray:
    boxes = layout.boxes[list(member)]
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _area(layout: Layout, members: Sequence[tuple[int, ...]]) -> float:
    return float(sum(layout.areas[list(member)].sum() for member in members))
