"""Strings to shape graphs. Reads everything that is written like SMILES, not only what the encoder writes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.shape.arrays import IntArray, TypeArray
from stages.shape.graphs.canonical import graph_digest
from stages.strings.alphabet import Alphabet
from stages.strings.tokens import StringError, Token, TokenKind, number_value, split_tokens


@dataclass(frozen=True)
class Decoded:
    """The graph of a string.

    types: int16 (n,), in the order of the string; edges: int32 (m, 2), pairs i < j in lexicographic order.
    texts: the tokens' texts; token_nodes, token_edges: `Token.node` and `Token.edge` of each.
    """

    types: TypeArray
    edges: IntArray
    texts: tuple[str, ...]
    token_nodes: tuple[int, ...]
    token_edges: tuple[int, ...]

    @cached_property
    def tokens(self) -> tuple[Token, ...]:
        """The tokens with what each stands for."""
        tokens, index, nodes = [], 0, 0
        for text, node, edge in zip(self.texts, self.token_nodes, self.token_edges, strict=True):
            kind: TokenKind = "open" if text == "(" else "close" if text == ")" else "cycle"
            if node == nodes:
                kind, nodes = "node", nodes + 1
            tokens.append(Token(index, text, kind, node, edge))
            index += len(text)
        return tuple(tokens)


def decode(string: str, alphabet: Alphabet) -> Decoded:
    """The graph that `string` stands for.

    A branch may be the last of its node, a number may be used again once both its nodes are there, and `%` may stand
    before small numbers. Raises StringError for an unknown token, parentheses that do not match, an empty branch, a
    branch or a number without a node before it, a number that stands once, an edge from a node to itself and two
    edges between the same nodes.
    """
    texts = split_tokens(string)
    type_of = alphabet.types
    types: list[int] = []
    ends: list[tuple[int, int]] = []
    token_nodes: list[int] = []
    token_edges: list[int] = []
    branches: list[tuple[int, int]] = []  # the node that each open branch hangs on, and the token that opened it
    numbers: dict[int, tuple[int, int]] = {}  # the node and the token where each open number began
    node = -1  # what the next token attaches to
    previous = ""  # what the last token was: "node" (or a number behind it), "(", ")"
    for place, text in enumerate(texts):
        kind = type_of.get(text)
        if kind is not None:
            fresh = len(types)
            token_nodes.append(fresh)
            token_edges.append(len(ends) if fresh else -1)
            if fresh:
                ends.append((node, fresh))
            types.append(kind)
            node = fresh
            previous = "node"
            continue
        if text == "(" or text == ")":
            fault = _branch_fault(text, previous, bool(branches))
            if fault:
                raise _error(string, texts, place, fault)
            if text == "(":
                branches.append((node, place))
            else:
                node, _ = branches.pop()
            token_nodes.append(-1)
            token_edges.append(-1)
            previous = text
            continue
        number = number_value(text)
        if number is None:
            raise _error(string, texts, place, _unknown(text, alphabet))
        if previous != "node":
            raise _error(string, texts, place, "a cycle number must stand right behind its node")
        token_nodes.append(node)
        if number not in numbers:
            numbers[number] = (node, place)
            token_edges.append(-1)
            continue
        other, begun = numbers.pop(number)
        if other == node:
            raise _error(string, texts, place, f"cycle number {number} leads from a node to itself")
        token_edges[begun] = len(ends)
        token_edges.append(len(ends))
        ends.append((other, node))
    if not types:
        raise StringError(string, 0, "the string is empty")
    if branches:
        raise _error(string, texts, branches[-1][1], "the branch is not closed")
    if numbers:
        number, (_, begun) = min(numbers.items(), key=lambda each: each[1][1])
        raise _error(string, texts, begun, f"cycle number {number} stands only once")
    return _graph(string, types, ends, texts, token_nodes, token_edges)


def equivalent(first: str, second: str, alphabet: Alphabet) -> bool:
    """Whether two strings stand for the same shape graph, up to isomorphism. Raises StringError if one is wrong."""
    one, other = decode(first, alphabet), decode(second, alphabet)
    if len(one.edges) != len(other.edges) or sorted(one.types.tolist()) != sorted(other.types.tolist()):
        return False
    return graph_digest(one.types, one.edges) == graph_digest(other.types, other.edges)


def _graph(
    string: str,
    types: list[int],
    ends: list[tuple[int, int]],
    texts: list[str],
    token_nodes: list[int],
    token_edges: list[int],
) -> Decoded:
    """The graph with its edges in order; the tokens name edges as they stand in `ends`, lower node first."""
    pairs = np.array(ends, dtype=np.int64).reshape(-1, 2)
    keys = pairs[:, 0] * len(types) + pairs[:, 1]
    order = np.argsort(keys, kind="stable")
    is_double = np.diff(keys[order]) == 0
    if is_double.any():
        later = int(order[1:][is_double].min())
        place = len(token_edges) - 1 - token_edges[::-1].index(later)
        raise _error(string, texts, place, "two edges join the same two nodes")
    row = np.append(np.argsort(order), -1)  # a token without an edge keeps its -1
    return Decoded(
        types=np.array(types, dtype=np.int16),
        edges=pairs[order].astype(np.int32),
        texts=tuple(texts),
        token_nodes=tuple(token_nodes),
        token_edges=tuple(row[token_edges].tolist()),
    )


def _branch_fault(text: str, previous: str, is_inside: bool) -> str:
    """What is wrong with a parenthesis after a `previous` token, or nothing."""
    if text == "(":
        return {"": "a string cannot begin with a branch", "(": "a branch must begin with a node"}.get(previous, "")
    if not is_inside:
        return "no branch is open here"
    return "the branch is empty" if previous == "(" else ""


def _unknown(text: str, alphabet: Alphabet) -> str:
    if text == "%":
        return "% must stand before two digits, or before a number in parentheses"
    known = ", ".join(alphabet.tokens[:3]) + (f" to {alphabet.tokens[-1]}" if len(alphabet.tokens) > 3 else "")
    return f"unknown token {text!r}; the alphabet is {known}"


def _error(string: str, texts: list[str], place: int, reason: str) -> StringError:
    return StringError(string, sum(map(len, texts[:place])), reason)
