"""From shape graphs to strings: random spanning trees and walks, and the canonical string (strings §5.1)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import IntArray, TypeArray
from stages.shape.graphs.canonical import canonical_order
from stages.strings.tokens import Alphabet, number_text

Indices = npt.NDArray[np.int64]

REPEATS_PER_KNOWN_STRING = 5
"""Random walks without a new string, per known string and four more, after which a graph counts as exhausted."""


class NotConnectedError(ValueError):
    """The graph is not connected, so it has no string."""


@dataclass(frozen=True)
class Encoded:
    """A string of a graph."""

    string: str
    nodes: npt.NDArray[np.int64]
    """The graph's node at each node of the string, int64 (n,)."""


def encode(
    types: TypeArray, edges: IntArray, alphabet: Alphabet, rng: np.random.Generator, cycles: bool = True
) -> Encoded:
    """Encode a graph as a random string: random spanning tree, random root, random order of the children.

    All cycles are broken at random edges. The tree is written depth first, each subtree of a node in parentheses except
    the last; broken edges are numbers after both of their nodes. Without `cycles` they are left out, and the string is
    that of a random spanning tree (strings §7, brick buildings).

    types: int16 (n,), at least one node; edges: int32 (m, 2), a simple graph. Raises NotConnectedError, and ValueError
    for an empty graph and for indices out of range.
    """
    from stages.strings.traversal import first_edges_tree

    letters, pairs = _checked(types, edges, alphabet)
    root = int(rng.integers(len(letters)))
    tree = first_edges_tree(len(letters), pairs, rng.permutation(len(pairs)))
    if not cycles:
        pairs, tree = pairs[tree], tree[tree]
    return _write(letters, pairs, tree, rng.permutation(len(pairs)), root, alphabet)


def random_strings(
    types: TypeArray,
    edges: IntArray,
    alphabet: Alphabet,
    count: int,
    rng: np.random.Generator,
    excluded: Collection[str] = (),
    cycles: bool = True,
) -> list[Encoded]:
    """Return `count` distinct random strings of a graph, none of them `excluded`; small graphs may have fewer.

    Arguments and errors as for `encode`.
    """
    seen = set(excluded)
    strings: list[Encoded] = []
    repeats = 0
    while len(strings) < count and repeats < REPEATS_PER_KNOWN_STRING * (4 + len(seen)):
        encoded = encode(types, edges, alphabet, rng, cycles)
        if encoded.string in seen:
            repeats += 1
        else:
            repeats = 0
            seen.add(encoded.string)
            strings.append(encoded)
    return strings


def canonical_string(types: TypeArray, edges: IntArray, alphabet: Alphabet, cycles: bool = True) -> Encoded:
    """Return the canonical string of a graph, equal for isomorphic graphs: depth first in canonical order.

    Without `cycles` it is that of the spanning tree of this walk. Arguments and errors as for `encode`, and ValueError
    for a graph that is not simple.
    """
    from stages.strings.traversal import depth_first_tree

    letters, _ = _checked(types, edges, alphabet)
    order = canonical_order(types, edges)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    pairs = np.sort(rank[np.asarray(edges).reshape(-1, 2)], axis=1)
    edge_order = np.argsort(pairs[:, 0] * len(order) + pairs[:, 1])
    tree = depth_first_tree(len(order), pairs, edge_order, 0)
    if not cycles:
        pairs, tree = pairs[edge_order][tree[edge_order]], tree[tree]
        edge_order = np.arange(len(pairs))
    encoded = _write(letters[order], pairs, tree, edge_order, 0, alphabet)
    return Encoded(encoded.string, order[encoded.nodes])


def _checked(types: TypeArray, edges: IntArray, alphabet: Alphabet) -> tuple[Indices, Indices]:
    """Return types and edges for compiled code, which does not check the range of indices."""
    letters = np.ascontiguousarray(types, dtype=np.int64)
    pairs = np.ascontiguousarray(edges, dtype=np.int64).reshape(-1, 2)
    if not len(letters):
        raise ValueError("a graph without nodes has no string")
    if letters.min() < 0 or letters.max() >= len(alphabet.tokens):
        raise ValueError(f"type {letters.max()} is not in the alphabet, which has {len(alphabet.tokens)} types")
    if len(pairs) and (pairs.min() < 0 or pairs.max() >= len(letters)):
        raise ValueError(f"an edge has a node out of range; the graph has {len(letters)} nodes")
    return letters, pairs


def _write(
    types: Indices, pairs: Indices, tree: npt.NDArray[np.bool_], edge_order: Indices, root: int, alphabet: Alphabet
) -> Encoded:
    from stages.strings.traversal import walk

    letters = len(alphabet.tokens)
    codes, nodes = walk(types, pairs, tree, edge_order, root, letters)
    if len(nodes) < len(types):
        raise NotConnectedError(f"{len(nodes)} of {len(types)} nodes are reachable from node {root}")
    texts = _texts(alphabet, max(int(codes.max()) - letters, 0) // 64)
    return Encoded("".join([texts[code] for code in codes.tolist()]), nodes)


@lru_cache(maxsize=64)
def _texts(alphabet: Alphabet, blocks: int) -> list[str]:
    """Return the text of each code, with `blocks` + 1 blocks of 64 cycle numbers."""
    return [*alphabet.tokens, "(", ")", *(number_text(number) for number in range(64 * (blocks + 1)))]
