"""Edge categories: the placement of each token's part relative to its parent in the string (strings §6).

A category is the type of a part, that of another, and a pose at which the second docks to the first, modulo symmetry: a
shaft on a shaft of four-fold symmetry is one category, and walls on a base are four. Category 0 is the paper's dummy
category for brackets. Then come one category for each type as the first of a string, and those of edges, by the type of
the first part, and the label and type of the second.

Along a string each part has a *frame*: its pose times one of its symmetries. The frame of a child is that of its parent
times the pose of its category, so a category determines a turn: after a tower, the next wall continues straight or to
the left, whatever the pose of the tower. Right categories are right poses, without search. A cycle number has the
category of its edge, seen from the part before it.

A string of an assembly has one canonical sequence of categories: the lexicographically least over the symmetric frames
of the first part and over the orders of equal branches.
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
from stages.strings.decoder import Decoded, decode
from stages.strings.encoder import Encoded
from stages.strings.tokens import Alphabet, make_alphabet

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

DUMMY_CATEGORY = 0
"""Of brackets."""
MAX_CATEGORY_TOLERANCES = 2.0
"""Between an edge and its category; images of a docking within one tolerance are one category."""

Indices = npt.NDArray[np.int16]


class NoCategoryError(ValueError):
    """Two parts have a relative pose that is no docking of the kit."""


@dataclass(frozen=True)
class CategorizedString:
    """A string with categories."""

    string: str
    nodes: npt.NDArray[np.int64]
    """The part at each node, int64 (n,); equal branches are in the order of their categories."""
    categories: IntArray
    """Of each token, int32 (tokens,)."""


@dataclass(frozen=True)
class PairPlacements:
    """The k placements of a part of one type, the child, docked to one of another, the parent."""

    first: int
    """Category of the first placement."""
    poses: FloatArray
    """The child's frame in the parent's, float64 (k, 4, 4)."""
    slack: FloatArray
    """Tolerance of each docking, float64 (k,)."""
    turned: Indices
    """The placement if the parent's frame is turned by a symmetry, int16 (symmetries, k)."""
    shifted: Indices
    """The symmetry of the child's frame then, int16 (symmetries, k)."""


class CategorySpace:
    """All categories of a kit; `len` is their number.

    types: int16 (categories, 2), of parent and child, or -1
    poses: float64 (categories, 4, 4), the child's frame in the parent's, or the identity
    masks: bool (labels + 1, labels + 1, categories), categories of an edge by the labels at its ends plus one, or 0
    """

    def __init__(self, kit: Kit) -> None:
        self.kit = kit
        self.alphabet: Alphabet = make_alphabet(kit.labels)
        self.pairs: dict[tuple[int, int], PairPlacements] = {}
        """By the types of parent and child, in the order of the categories."""
        self._lengths = [part_type.diagonal / 2 for part_type in kit.types]
        self._groups = [
            _group(part_type.symmetries, kit.pose_tolerance, part_type.diagonal / 2) for part_type in kit.types
        ]
        self._products = [
            _nearest(_vectors(group[:, None] @ group, length), _vectors(group, length))[0]
            for group, length in zip(self._groups, self._lengths, strict=True)
        ]
        self._images: dict[tuple[int, int], cKDTree] = {}
        """All poses of the child in the parent's frame, by pair, placement and symmetry of the child."""
        roots = np.stack([np.full(len(kit.types), -1), np.arange(len(kit.types))], axis=1)
        types, poses = [np.full((1, 2), -1), roots], [np.tile(np.eye(4), (1 + len(roots), 1, 1))]
        first = 1 + len(roots)
        dockings = _directed_dockings(kit)
        for a, b in sorted(dockings, key=lambda pair: (pair[0], int(kit.label_of[pair[1]]), pair[1])):
            placements = self._placements(a, b, first, dockings[a, b])
            types.append(np.tile((a, b), (len(placements.poses), 1)))
            poses.append(placements.poses)
            first += len(placements.poses)
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
        """Return some strings of an assembly with their categories.

        With `either_hand`, they are those of the assembly or of its mirror image, whichever are less, if its parts and
        dockings are mirror-symmetric: a string does not distinguish left from right. Raises NoCategoryError for an edge
        without a category.
        """
        own = self._label(assembly, strings)
        image = self.mirror_image(assembly) if either_hand else None
        if image is None:
            return own
        try:
            mirrored = self._label(image, strings)
        except NoCategoryError:
            return own
        return [min(pair, key=lambda string: string.categories.tolist()) for pair in zip(own, mirrored, strict=True)]

    def mirror_image(self, assembly: Assembly) -> Assembly | None:
        """Return the mirror image of an assembly, if each of its parts is mirror-symmetric."""
        mirrors = [self._mirrors[kind] for kind in assembly.types.tolist()]
        if any(mirror is None for mirror in mirrors):
            return None
        poses = np.diag([-1.0, 1.0, 1.0, 1.0]) @ assembly.poses @ np.array(mirrors)
        return Assembly(assembly.types, poses, assembly.edges)

    def place(self, string: str, categories: Sequence[int] | npt.NDArray[np.integer]) -> Assembly:
        """Return the parts of a string, in its order, placed by their categories; the first is at the identity.

        Poses are frames: they differ from those of a labelled assembly by symmetries of the parts and one transform of
        all. Edges are those of the string; categories of cycle numbers are ignored. Raises StringError, and ValueError
        for categories that do not fit the tokens and parts.
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
                raise ValueError(f"token {token} has category {category}, which does not fit it")
            if decoded.texts[token] not in self.alphabet.types:
                continue
            parent, child = self.types[category].tolist()
            if here >= 0 and types[here] != parent:
                raise ValueError(
                    f"part {there} has category {category}, which docks to another type than that of part {here}"
                )
            types[there] = child
            frames[there] = self.poses[category] if here < 0 else frames[here] @ self.poses[category]
        return Assembly(types, frames, decoded.edges)

    def allowed(self, string: str) -> BoolArray:
        """Return the possible categories of each token by labels alone, bool (tokens, categories): the mask of §6.

        A row is empty if the kit has no contact of the two labels. Raises StringError.
        """
        decoded = decode(string, self.alphabet)
        return self._allowed(decoded, token_edges(decoded))

    def _allowed(self, decoded: Decoded, edges: IntArray) -> BoolArray:
        here, there = np.append(decoded.types + 1, 0)[edges].T
        allowed: BoolArray = self.masks[here, there]
        return allowed

    def categories_between(self, parent: int | None, label: int) -> range:
        """Return the categories of a part of a label with a parent of some type, or as the first of a string."""
        fits = (self.types[:, 0] == (-1 if parent is None else parent)) & (self.types[:, 1] >= 0)
        rows = np.flatnonzero(fits & (self.kit.label_of[self.types[:, 1]] == label))
        return range(int(rows[0]), int(rows[-1]) + 1) if len(rows) else range(0)

    def nearest(self, a: int, b: int, relative: FloatArray) -> tuple[Indices, Indices, FloatArray]:
        """Return the nearest placements of parts of type `b` at poses `relative` (m, 4, 4) in a frame of type `a`.

        They are indices in `pairs[a, b]`, with the symmetry of `b` that yields the child's frame, and the gap in units
        of the kit, (m,) each.
        """
        gap, index = self._images[a, b].query(pose_vectors(relative, self._lengths[b]))
        placement, symmetry = np.divmod(index, len(self._groups[b]))
        return placement.astype(np.int16), symmetry.astype(np.int16), gap

    @cached_property
    def _mirrors(self) -> list[FloatArray | None]:
        """A reflection (4, 4) that maps a part of each type onto itself, or None."""
        from stages.exemplars.congruence import comparable_mesh, congruences

        mirrors: list[FloatArray | None] = []
        for part_type in self.kit.types:
            mesh = comparable_mesh(part_type.vertices, part_type.faces)
            transforms = congruences(mesh, mesh, self.kit.pose_tolerance / part_type.diagonal, reflections=True)
            reflections = transforms[np.linalg.det(transforms[:, :3, :3]) < 0]
            mirrors.append(reflections[0] if len(reflections) else None)
        return mirrors

    def _label(self, assembly: Assembly, strings: Sequence[Encoded]) -> list[CategorizedString]:
        edges = np.concatenate([assembly.edges, assembly.edges[:, ::-1]])
        relative = relative_poses(assembly.poses, edges)
        placement, symmetry = np.full(len(edges), -1), np.zeros(len(edges), np.int64)
        ends = assembly.types[edges]
        for a, b in np.unique(ends, axis=0).tolist():
            rows = np.flatnonzero((ends[:, 0] == a) & (ends[:, 1] == b))
            if (a, b) in self.pairs:
                nearest, turn, gap = self.nearest(a, b, relative[rows])
                is_docked = gap <= MAX_CATEGORY_TOLERANCES * self.pairs[a, b].slack[nearest]
                placement[rows] = np.where(is_docked, nearest, -1)
                symmetry[rows] = turn
        pairs = zip(placement.tolist(), symmetry.tolist(), strict=True)
        docked = dict(zip(map(tuple, edges.tolist()), pairs, strict=True))
        return [self._walk(assembly.types, docked, string) for string in strings]

    def _walk(
        self, types: TypeArray, docked: dict[tuple[int, ...], tuple[int, int]], encoded: Encoded
    ) -> CategorizedString:
        """Return a string with its categories, from placement and symmetry of each edge by the parts' own poses."""
        decoded, nodes = decode(encoded.string, self.alphabet), encoded.nodes.tolist()
        kinds = types[encoded.nodes].tolist()
        edges = token_edges(decoded)
        # One column for each frame of the first part: categories, and the symmetry of each node's frame.
        columns = np.arange(len(self._groups[kinds[0]]))
        categories = np.full((len(edges), len(columns)), DUMMY_CATEGORY, dtype=np.int32)
        frames = np.zeros((len(kinds), len(columns)), dtype=np.int16)
        frames[0] = columns
        categories[0] = 1 + kinds[0]
        for token, (here, there) in enumerate(edges.tolist()):
            if here < 0:
                continue
            placement, symmetry = docked[nodes[here], nodes[there]]
            if placement < 0:
                names = (self.kit.types[kinds[node]].name for node in (here, there))
                raise NoCategoryError(f"{' and '.join(names)} have a relative pose that the kit does not have")
            pair = self.pairs[kinds[here], kinds[there]]
            categories[token] = pair.first + pair.turned[frames[here], placement]
            if decoded.texts[token] in self.alphabet.types:
                frames[there] = self._products[kinds[there]][symmetry, pair.shifted[frames[here], placement]]
        parts = np.repeat(encoded.nodes[:, None], len(columns), axis=1)
        for branches in _equal_branches(decoded, edges, self.alphabet):
            _sort_branches(categories, parts, branches, np.array(decoded.token_nodes))
        least = min(columns.tolist(), key=lambda column: categories[:, column].tolist())
        return CategorizedString(encoded.string, parts[:, least], categories[:, least])

    def _placements(self, a: int, b: int, first: int, dockings: list[tuple[FloatArray, float]]) -> PairPlacements:
        """Return the placements of a pair of types.

        Those of one docking are images of the first under symmetries of the parent alone, so in the child's frame the
        parent has one pose for all of them.
        """
        from scipy.spatial import cKDTree

        kit, length, group = self.kit, self._lengths[b], self._groups[b]
        poses, slack, images = np.empty((0, 4, 4)), [], np.empty((0, 12))
        for docking, tolerance in dockings:
            for pose in self._groups[a] @ docking:
                if len(images) and _nearest(pose_vectors(pose[None], length), images)[1][0] <= kit.pose_tolerance:
                    continue
                poses = np.concatenate([poses, pose[None]])
                images = np.concatenate([images, pose_vectors(pose @ invert(group), length)])
                slack.append(tolerance)
        self._images[a, b] = cKDTree(images)
        turned_poses = invert(self._groups[a])[:, None] @ poses
        _, index = self._images[a, b].query(_vectors(turned_poses, length))
        turned, shifted = np.divmod(index, len(group))
        placements = PairPlacements(first, poses, np.array(slack), turned.astype(np.int16), shifted.astype(np.int16))
        self.pairs[a, b] = placements
        return placements


def token_edges(decoded: Decoded) -> IntArray:
    """Return the edge of each token, int32 (tokens, 2), as (from node, to node).

    From its parent to a part; from -1 to the first part; from the part of a cycle number to the part at its other end;
    from -1 to -1 for brackets.
    """
    ends = np.append(decoded.edges, [[-1, -1]], axis=0)[list(decoded.token_edges)]
    nodes = np.array(decoded.token_nodes)
    is_cycle = nodes <= np.maximum.accumulate(np.append(-1, nodes[:-1]))
    # A part is the greater end of its edge to its parent, and either end of the edge of a cycle number.
    other = ends.sum(axis=1) - nodes
    here, there = np.where(is_cycle, nodes, other), np.where(is_cycle, other, nodes)
    directed = np.stack([here, there], axis=1)
    directed[nodes < 0] = -1
    directed[0] = -1, 0
    return directed.astype(np.int32)


def _equal_branches(decoded: Decoded, edges: IntArray, alphabet: Alphabet) -> list[list[range]]:
    """Return groups of equal branches of a part without cycle numbers, as the tokens of each, innermost first."""
    ends = [0] * len(decoded.texts)
    opened: list[list[int]] = [[]]  # parts without an end, by open bracket
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
    return [branches for branches in reversed(groups.values()) if len(branches) > 1]


def _sort_branches(
    categories: IntArray, parts: npt.NDArray[np.int64], branches: Sequence[range], nodes: npt.NDArray[np.integer]
) -> None:
    """Sort equal branches, and their parts, by categories in each column."""
    of_tokens = np.array([list(branch) for branch in branches])
    of_nodes = nodes[of_tokens]
    of_nodes = of_nodes[:, of_nodes[0] >= 0]
    for column in range(categories.shape[1]):
        order = sorted(range(len(branches)), key=categories[of_tokens, column].tolist().__getitem__)
        categories[of_tokens, column] = categories[of_tokens[order], column]
        parts[of_nodes, column] = parts[of_nodes[order], column]


def _directed_dockings(kit: Kit) -> dict[tuple[int, int], list[tuple[FloatArray, float]]]:
    """Return poses and tolerances of the dockings of each ordered pair of types; those of exemplars first."""
    dockings: dict[tuple[int, int], list[tuple[FloatArray, float]]] = {}
    for docking in sorted(kit.grammar.dockings, key=lambda docking: docking.slack > 0):
        tolerance = docking.slack or kit.pose_tolerance
        dockings.setdefault((docking.a, docking.b), []).append((docking.pose, tolerance))
        dockings.setdefault((docking.b, docking.a), []).append((invert(docking.pose), tolerance))
    return dockings


def _group(symmetries: FloatArray, tolerance: float, length: float) -> FloatArray:
    """Return the symmetries of a part if they form a group, else the identity alone."""
    _, gap = _nearest(_vectors(symmetries[:, None] @ symmetries, length), _vectors(symmetries, length))
    return symmetries if gap.max() <= tolerance else symmetries[:1]


def _vectors(poses: FloatArray, length: float) -> FloatArray:
    """Return `pose_vectors` of poses (..., 4, 4), (..., 12)."""
    return pose_vectors(poses.reshape(-1, 4, 4), length).reshape(*poses.shape[:-2], 12)


def _nearest(vectors: FloatArray, among: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Return the first nearest row of `among` (n, d) for each of `vectors` (..., d), and the gap."""
    gaps = np.linalg.norm(vectors[..., None, :] - among, axis=-1)
    index = gaps.argmin(axis=-1)
    return index, np.take_along_axis(gaps, index[..., None], axis=-1)[..., 0]
