"""Shape graphs to strings: random spanning trees, random walks, and the canonical string (strings §5.1)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import IntArray, TypeArray
from stages.shape.graphs.canonical import canonical_order
from stages.strings.alphabet import Alphabet
from stages.strings.tokens import number_text

Indices = npt.NDArray[np.int64]

REPEATS_PER_KNOWN_STRING = 5
"""A graph counts as having no more strings after so many random walks in a row, for each string it is known to have
and four besides, that brought nothing new."""


class NotConnectedError(ValueError):
    """The graph falls into pieces, so no string can walk it."""


@dataclass(frozen=True)
class Encoded:
    """string: the graph as text; nodes: int64 (n,), the graph's node at each node of the string, in order."""

    string: str
    nodes: npt.NDArray[np.int64]


def encode(
    types: TypeArray, edges: IntArray, alphabet: Alphabet, rng: np.random.Generator, cycles: bool = True
) -> Encoded:
    """A random string of a graph: random spanning tree, random root, random order of the children.

    All cycles are broken at random edges; the tree that is left is written depth first, each subtree of a node in
    parentheses except the last; the broken edges come back as numbers behind both of their nodes. Without `cycles` they
    do not come back: the string is that of a random spanning tree (strings §7, brick buildings).

    types: int16 (n,), at least one node; edges: int32 (m, 2), a simple graph. Raises NotConnectedError, and ValueError
    if the graph is empty or an edge or a type names what is not there.
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
    besides: Collection[str] = (),
    cycles: bool = True,
) -> list[Encoded]:
    """`count` distinct random strings of a graph, none of them in `besides`.

    Fewer if `REPEATS_PER_KNOWN_STRING`: small graphs have few strings. Arguments and errors as for `encode`.
    """
    seen = set(besides)
    found: list[Encoded] = []
    in_vain = 0
    while len(found) < count and in_vain < REPEATS_PER_KNOWN_STRING * (4 + len(seen)):
        encoded = encode(types, edges, alphabet, rng, cycles)
        if encoded.string in seen:
            in_vain += 1
        else:
            in_vain = 0
            seen.add(encoded.string)
            found.append(encoded)
    return found


def canonical_string(types: TypeArray, edges: IntArray, alphabet: Alphabet, cycles: bool = True) -> Encoded:
    """The canonical string of a graph, the same for all isomorphic graphs: depth first in canonical order. Without
    `cycles`, that of the spanning tree which such a walk goes along.

    Arguments and errors as for `encode`, and ValueError if the graph is not simple.
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
    """Types and edges as the compiled code takes them, which does not look whether an index is in range."""
    letters = np.ascontiguousarray(types, dtype=np.int64)
    pairs = np.ascontiguousarray(edges, dtype=np.int64).reshape(-1, 2)
    if not len(letters):
        raise ValueError("a graph without nodes has no string")
    if letters.min() < 0 or letters.max() >= len(alphabet.tokens):
        raise ValueError(f"type {letters.max()} is not in the alphabet, which has {len(alphabet.tokens)} types")
    if len(pairs) and (pairs.min() < 0 or pairs.max() >= len(letters)):
        raise ValueError(f"an edge names a node that is not there; the graph has {len(letters)} nodes")
    return letters, pairs


def _write(
    types: Indices, pairs: Indices, tree: npt.NDArray[np.bool_], edge_order: Indices, root: int, alphabet: Alphabet
) -> Encoded:
    from stages.strings.traversal import walk

    letters = len(alphabet.tokens)
    codes, nodes = walk(types, pairs, tree, edge_order, root, letters)
    if len(nodes) < len(types):
        raise NotConnectedError(f"{len(nodes)} of {len(types)} nodes are in reach of node {root}")
    texts = _texts(alphabet, max(int(codes.max()) - letters, 0) // 64)
    return Encoded("".join([texts[code] for code in codes.tolist()]), nodes)


@lru_cache(maxsize=64)
def _texts(alphabet: Alphabet, blocks: int) -> list[str]:
    """The text of each code; 64 cycle numbers a block, and one block more."""
    return [*alphabet.tokens, "(", ")", *(number_text(number) for number in range(64 * (blocks + 1)))]
