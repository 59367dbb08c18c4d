"""Edge categories: where the part of each token stands beside the one that it hangs on (strings §6).

A category is the type of a part, that of another, and a pose at which the second docks to the first: one for all poses
that put its surface in the same place. So the docking of a shaft on a shaft of four-fold symmetry is one category, and
walls hang on a base in four. Category 0 is the paper's dummy category, that of brackets; then comes one for each type
as the first of a string; then those of edges, by the type of the first part, the label of the second and its type.

Walking a string, each part has a *frame*: its pose followed by one of its symmetries. A child's frame is that of its
parent followed by the pose of its category, so that frames are carried along the string, and a category tells of a
turn: beyond a tower, the next wall goes on straight or to the left, wherever the tower itself was put. All categories
right are all poses right, and nothing is left to search for. A cycle number has the category of its edge, seen from the
part that it stands behind.

A string of an assembly has one sequence of categories: of all that differ by the frame of the first part, which may be
any of its symmetric ones, and by which of some equal branches of a part is which, the lexicographically least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import BoolArray, FloatArray, IntArray, TypeArray
from stages.shape.geometry.pose import invert, pose_vectors, relative_poses
from stages.shape.kit import Assembly, Kit
from stages.strings.alphabet import Alphabet, make_alphabet
from stages.strings.decoder import Decoded, decode
from stages.strings.encoder import Encoded

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

DUMMY_CATEGORY = 0
"""The category of brackets."""
MAX_CATEGORY_TOLERANCES = 2.0
"""An edge has the nearest category if that is at most so many tolerances away: images of a docking that are one
tolerance apart are one category."""

Indices = npt.NDArray[np.int16]


class NoCategoryError(ValueError):
    """Two parts stand as the kit has not seen parts of their types stand."""


@dataclass(frozen=True)
class CategorizedString:
    """A string with categories.

    nodes: int64 (n,), the part at each node of the string, those of equal branches in the order of their categories;
    categories: int32 (tokens,), one for each token.
    """

    string: str
    nodes: npt.NDArray[np.int64]
    categories: IntArray


@dataclass(frozen=True)
class PairPlacements:
    """How a part of one type, the child, docks to one of another, the parent.

    first: the category of the first place; poses: float64 (k, 4, 4), the child's frame in the parent's, one each place;
    slack: float64 (k,), how far from its pose a docking holds.
    turned, shifted: int16 (symmetries of the parent, k); where the parent's frame is followed by a symmetry, a place
    becomes another, and the child's frame is followed by a symmetry of the child.
    """

    first: int
    poses: FloatArray
    slack: FloatArray
    turned: Indices
    shifted: Indices


class CategorySpace:
    """All categories of a kit; `len` of it is the radix of a token.

    types: int16 (categories, 2), those of parent and child, -1 where there is none; poses: float64 (categories, 4, 4),
    the child's frame in the parent's, the identity where there is no parent; masks: bool (labels + 1, labels + 1,
    categories), which categories an edge may have, by the labels at its ends plus one, 0 where there is none.
    """

    def __init__(self, kit: Kit) -> None:
        self.kit = kit
        self.alphabet: Alphabet = make_alphabet(kit.labels)
        self.pairs: dict[tuple[int, int], PairPlacements] = {}
        """By the types of parent and child, in the order of the categories."""
        self._lengths = [each.diagonal / 2 for each in kit.types]
        self._groups = [_group(each.symmetries, kit.pose_tolerance, each.diagonal / 2) for each in kit.types]
        self._products = [
            _nearest(_vectors(group[:, None] @ group, length), _vectors(group, length))[0]
            for group, length in zip(self._groups, self._lengths, strict=True)
        ]
        self._images: dict[tuple[int, int], cKDTree] = {}
        """Of each pair all poses of the child beside the parent's frame, by place, then by symmetry of the child."""
        roots = np.stack([np.full(len(kit.types), -1), np.arange(len(kit.types))], axis=1)
        types, poses = [np.full((1, 2), -1), roots], [np.tile(np.eye(4), (1 + len(roots), 1, 1))]
        first = 1 + len(roots)
        dockings = _directed_dockings(kit)
        for a, b in sorted(dockings, key=lambda pair: (pair[0], int(kit.label_of[pair[1]]), pair[1])):
            places = self._places(a, b, first, dockings[a, b])
            types.append(np.tile((a, b), (len(places.poses), 1)))
            poses.append(places.poses)
            first += len(places.poses)
        self.types: TypeArray = np.concatenate(types).astype(np.int16)
        self.poses: FloatArray = np.concatenate(poses)
        labels = np.append(kit.label_of, -1)[self.types]  # type -1 has label -1
        ends = np.arange(-1, len(kit.labels))
        self.masks: BoolArray = (labels[:, 0] == ends[:, None, None]) & (labels[:, 1] == ends[:, None])

    def __len__(self) -> int:
        return len(self.types)

    def label(
        self, assembly: Assembly, strings: Sequence[Encoded], either_hand: bool = False
    ) -> list[CategorizedString]:
        """Some strings of an assembly with their categories.

        With `either_hand`, those of the assembly or of its mirror image, whichever are less, if its parts are their own
        mirror images and stand in the mirror as parts of the kit do: a string does not tell left from right.

        Raises NoCategoryError for an edge of a string whose parts stand as none of their types was seen to.
        """
        found = self._label(assembly, strings)
        image = self.mirror_image(assembly) if either_hand else None
        if image is None:
            return found
        try:
            others = self._label(image, strings)
        except NoCategoryError:
            return found
        return [min(pair, key=lambda each: each.categories.tolist()) for pair in zip(found, others, strict=True)]

    def mirror_image(self, assembly: Assembly) -> Assembly | None:
        """An assembly in the mirror, if each of its parts is its own mirror image."""
        mirrors = [self._mirrors[kind] for kind in assembly.types.tolist()]
        if any(each is None for each in mirrors):
            return None
        poses = np.diag([-1.0, 1.0, 1.0, 1.0]) @ assembly.poses @ np.array(mirrors)
        return Assembly(assembly.types, poses, assembly.edges)

    def place(self, string: str, categories: Sequence[int] | npt.NDArray[np.integer]) -> Assembly:
        """The parts of a string, in its order, where its categories put them; the first stands at the identity.

        Poses are frames: they differ from those of the assembly that was labelled by symmetries of the parts, and by
        one motion of all. Edges are those of the string; those of cycle numbers have no say. Raises StringError, and
        ValueError for categories that are not of these tokens and parts.
        """
        decoded = decode(string, self.alphabet)
        edges = token_edges(decoded)
        if len(categories) != len(edges):
            raise ValueError(f"{len(edges)} tokens have {len(categories)} categories")
        types = np.full(len(decoded.types), -1, dtype=np.int16)
        frames = np.empty((len(types), 4, 4))
        allowed = self._allowed(decoded, edges)
        for token, ((here, there), category) in enumerate(zip(edges.tolist(), categories, strict=True)):
            if not 0 <= category < len(self) or not allowed[token, category]:
                raise ValueError(f"token {token} has category {category}, which is none of its kind")
            if decoded.texts[token] not in self.alphabet.types:
                continue
            parent, child = self.types[category].tolist()
            if here >= 0 and types[here] != parent:
                raise ValueError(
                    f"part {there} has category {category}, which is beside another type than part {here} is"
                )
            types[there] = child
            frames[there] = self.poses[category] if here < 0 else frames[here] @ self.poses[category]
        return Assembly(types, frames, decoded.edges)

    def allowed(self, string: str) -> BoolArray:
        """Which categories each token of a string may have, by the labels of its parts alone, bool (tokens,
        categories): the mask of §6. A row is empty where the kit knows no contact of two labels. Raises StringError."""
        decoded = decode(string, self.alphabet)
        return self._allowed(decoded, token_edges(decoded))

    def _allowed(self, decoded: Decoded, edges: IntArray) -> BoolArray:
        here, there = np.append(decoded.types + 1, 0)[edges].T
        found: BoolArray = self.masks[here, there]
        return found

    def beside(self, parent: int | None, label: int) -> range:
        """The categories of a part of a label beside one of type `parent`, or as the first of a string."""
        fits = (self.types[:, 0] == (-1 if parent is None else parent)) & (self.types[:, 1] >= 0)
        found = np.flatnonzero(fits & (self.kit.label_of[self.types[:, 1]] == label))
        return range(int(found[0]), int(found[-1]) + 1) if len(found) else range(0)

    def nearest(self, a: int, b: int, relative: FloatArray) -> tuple[Indices, Indices, FloatArray]:
        """For parts of type `b` at poses `relative` (m, 4, 4) in the frame of one of type `a`: the nearest of
        `pairs[a, b]`, the symmetry of `b` which then makes the child's frame of its pose, and the gap between them in
        the units of the kit, (m,) each."""
        gap, index = self._images[a, b].query(pose_vectors(relative, self._lengths[b]))
        place, symmetry = np.divmod(index, len(self._groups[b]))
        return place.astype(np.int16), symmetry.astype(np.int16), gap

    @cached_property
    def _mirrors(self) -> list[FloatArray | None]:
        """For each type a reflection (4, 4) that maps its parts onto themselves."""
        from stages.exemplars.congruence import comparable_mesh, congruences

        found: list[FloatArray | None] = []
        for each in self.kit.types:
            mesh = comparable_mesh(each.vertices, each.faces)
            motions = congruences(mesh, mesh, self.kit.pose_tolerance / each.diagonal, reflections=True)
            turning = motions[np.linalg.det(motions[:, :3, :3]) < 0]
            found.append(turning[0] if len(turning) else None)
        return found

    def _label(self, assembly: Assembly, strings: Sequence[Encoded]) -> list[CategorizedString]:
        edges = np.concatenate([assembly.edges, assembly.edges[:, ::-1]])
        relative = relative_poses(assembly.poses, edges)
        place, symmetry = np.full(len(edges), -1), np.zeros(len(edges), np.int64)
        ends = assembly.types[edges]
        for a, b in np.unique(ends, axis=0).tolist():
            rows = np.flatnonzero((ends[:, 0] == a) & (ends[:, 1] == b))
            if (a, b) in self.pairs:
                found, turn, gap = self.nearest(a, b, relative[rows])
                place[rows] = np.where(gap <= MAX_CATEGORY_TOLERANCES * self.pairs[a, b].slack[found], found, -1)
                symmetry[rows] = turn
        docked = dict(zip(map(tuple, edges.tolist()), zip(place.tolist(), symmetry.tolist(), strict=True), strict=True))
        return [self._walk(assembly.types, docked, each) for each in strings]

    def _walk(
        self, types: TypeArray, docked: dict[tuple[int, ...], tuple[int, int]], encoded: Encoded
    ) -> CategorizedString:
        """A string with its categories, by the places and symmetries of its edges beside the parts' own poses."""
        decoded, nodes = decode(encoded.string, self.alphabet), encoded.nodes.tolist()
        kinds = types[encoded.nodes].tolist()
        edges = token_edges(decoded)
        # A column for each frame of the first part: the categories, and for each node the symmetry of its frame.
        columns = np.arange(len(self._groups[kinds[0]]))
        found = np.full((len(edges), len(columns)), DUMMY_CATEGORY, dtype=np.int32)
        frames = np.zeros((len(kinds), len(columns)), dtype=np.int16)
        frames[0] = columns
        found[0] = 1 + kinds[0]
        for token, (here, there) in enumerate(edges.tolist()):
            if here < 0:
                continue
            place, symmetry = docked[nodes[here], nodes[there]]
            if place < 0:
                names = (self.kit.types[kinds[each]].name for each in (here, there))
                raise NoCategoryError(f"{' and '.join(names)} stand as the kit has not seen them")
            pair = self.pairs[kinds[here], kinds[there]]
            found[token] = pair.first + pair.turned[frames[here], place]
            if decoded.texts[token] in self.alphabet.types:
                frames[there] = self._products[kinds[there]][symmetry, pair.shifted[frames[here], place]]
        parts = np.repeat(encoded.nodes[:, None], len(columns), axis=1)
        for branches in _equal_branches(decoded, edges, self.alphabet):
            _sort_branches(found, parts, branches, np.array(decoded.token_nodes))
        least = min(columns.tolist(), key=lambda column: found[:, column].tolist())
        return CategorizedString(encoded.string, parts[:, least], found[:, least])

    def _places(self, a: int, b: int, first: int, dockings: list[tuple[FloatArray, float]]) -> PairPlacements:
        """The places of a pair of types. All places of one docking are images of its first under symmetries of the
        parent alone, so that, seen from the child's frame, the parent stands in one place for them all."""
        from scipy.spatial import cKDTree

        kit, length, group = self.kit, self._lengths[b], self._groups[b]
        poses, slack, images = np.empty((0, 4, 4)), [], np.empty((0, 12))
        for docking, holds in dockings:
            for pose in self._groups[a] @ docking:
                if len(images) and _nearest(pose_vectors(pose[None], length), images)[1][0] <= kit.pose_tolerance:
                    continue
                poses = np.concatenate([poses, pose[None]])
                images = np.concatenate([images, pose_vectors(pose @ invert(group), length)])
                slack.append(holds)
        self._images[a, b] = cKDTree(images)
        seen = invert(self._groups[a])[:, None] @ poses
        _, index = self._images[a, b].query(_vectors(seen, length))
        turned, shifted = np.divmod(index, len(group))
        places = PairPlacements(first, poses, np.array(slack), turned.astype(np.int16), shifted.astype(np.int16))
        self.pairs[a, b] = places
        return places


def token_edges(decoded: Decoded) -> IntArray:
    """The edge of each token as it sees it, int32 (tokens, 2): from its parent to a part, from -1 to the first one,
    from the part of a cycle number to the part at its other end, from -1 to -1 for brackets."""
    ends = np.append(decoded.edges, [[-1, -1]], axis=0)[list(decoded.token_edges)]
    nodes = np.array(decoded.token_nodes)
    is_cycle = nodes <= np.maximum.accumulate(np.append(-1, nodes[:-1]))
    # The part itself is the greater end of its edge to its parent, and either end of that of a cycle number.
    other = ends.sum(axis=1) - nodes
    here, there = np.where(is_cycle, nodes, other), np.where(is_cycle, other, nodes)
    found = np.stack([here, there], axis=1)
    found[nodes < 0] = -1
    found[0] = -1, 0
    return found.astype(np.int32)


def _equal_branches(decoded: Decoded, edges: IntArray, alphabet: Alphabet) -> list[list[range]]:
    """The branches of a part that are equal, token for token, and that no cycle number ties to others; as the tokens of
    each, the innermost first."""
    ends = [0] * len(decoded.texts)
    opened: list[list[int]] = [[]]  # of each open bracket, and of the whole string, the parts without an end
    for token, text in enumerate(decoded.texts):
        if text == "(":
            opened.append([])
        elif text == ")":
            for part in opened.pop():
                ends[part] = token
        elif text in alphabet.types:
            opened[-1].append(token)
    for part in opened[0]:
        ends[part] = len(ends)
    groups: dict[tuple[int, tuple[str, ...]], list[range]] = {}
    for token, (here, _) in enumerate(edges.tolist()):
        if here >= 0 and decoded.texts[token] in alphabet.types:
            branch = range(token, ends[token])
            texts = decoded.texts[token : ends[token]]
            if all(text in alphabet.types or text in "()" for text in texts):
                groups.setdefault((here, texts), []).append(branch)
    return [each for each in reversed(groups.values()) if len(each) > 1]


def _sort_branches(
    found: IntArray, parts: npt.NDArray[np.int64], branches: Sequence[range], nodes: npt.NDArray[np.integer]
) -> None:
    """Let equal branches have their categories in ascending order, and their parts with them, in each column."""
    of_tokens = np.array([list(each) for each in branches])
    of_nodes = nodes[of_tokens]
    of_nodes = of_nodes[:, of_nodes[0] >= 0]
    for column in range(found.shape[1]):
        order = sorted(range(len(branches)), key=found[of_tokens, column].tolist().__getitem__)
        found[of_tokens, column] = found[of_tokens[order], column]
        parts[of_nodes, column] = parts[of_nodes[order], column]


def _directed_dockings(kit: Kit) -> dict[tuple[int, int], list[tuple[FloatArray, float]]]:
    """For each ordered pair of types the poses of its dockings and how far each holds; those that were seen first."""
    found: dict[tuple[int, int], list[tuple[FloatArray, float]]] = {}
    for docking in sorted(kit.grammar.dockings, key=lambda each: each.slack > 0):
        holds = docking.slack or kit.pose_tolerance
        found.setdefault((docking.a, docking.b), []).append((docking.pose, holds))
        found.setdefault((docking.b, docking.a), []).append((invert(docking.pose), holds))
    return found


def _group(symmetries: FloatArray, tolerance: float, length: float) -> FloatArray:
    """The symmetries of a part, if each two of them make another; else the identity alone."""
    _, gap = _nearest(_vectors(symmetries[:, None] @ symmetries, length), _vectors(symmetries, length))
    return symmetries if gap.max() <= tolerance else symmetries[:1]


def _vectors(poses: FloatArray, length: float) -> FloatArray:
    """`pose_vectors` of poses (..., 4, 4), (..., 12)."""
    return pose_vectors(poses.reshape(-1, 4, 4), length).reshape(*poses.shape[:-2], 12)


def _nearest(vectors: FloatArray, among: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """The nearest row of `among` (n, d) for each of `vectors` (..., d), of equally near ones the first, and the gap."""
    gaps = np.linalg.norm(vectors[..., None, :] - among, axis=-1)
    index = gaps.argmin(axis=-1)
    return index, np.take_along_axis(gaps, index[..., None], axis=-1)[..., 0]
