"""From strings to shape graphs; any SMILES-like string is read, not only those of the encoder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.shape.arrays import IntArray, TypeArray
from stages.strings.tokens import Alphabet, StringError, Token, TokenKind, number_value, split_tokens


@dataclass(frozen=True)
class Decoded:
    """The graph of a string."""

    types: TypeArray
    """int16 (n,), in the order of the string."""
    edges: IntArray
    """int32 (m, 2), pairs i < j in lexicographic order."""
    texts: tuple[str, ...]
    """Of the tokens."""
    token_nodes: tuple[int, ...]
    """`Token.node` of each."""
    token_edges: tuple[int, ...]
    """`Token.edge` of each."""

    @cached_property
    def tokens(self) -> tuple[Token, ...]:
        """The tokens, with their nodes and edges."""
        tokens, index, nodes = [], 0, 0
        for text, node, edge in zip(self.texts, self.token_nodes, self.token_edges, strict=True):
            kind: TokenKind = "open" if text == "(" else "close" if text == ")" else "cycle"
            if node == nodes:
                kind, nodes = "node", nodes + 1
            tokens.append(Token(index, text, kind, node, edge))
            index += len(text)
        return tuple(tokens)


def decode(string: str, alphabet: Alphabet) -> Decoded:
    """Decode a string.

    A branch may be the last of its node, a number may be reused after both its nodes, and `%` may precede small
    numbers. Raises StringError for unknown tokens, unmatched parentheses, empty branches, branches and numbers without
    a node, numbers without a partner, loops and double edges.
    """
    texts = split_tokens(string)
    type_of = alphabet.types
    types: list[int] = []
    ends: list[tuple[int, int]] = []
    token_nodes: list[int] = []
    token_edges: list[int] = []
    branches: list[tuple[int, int]] = []  # parent node and opening token of each open branch
    numbers: dict[int, tuple[int, int]] = {}  # node and token of each open number
    node = -1  # what the next token attaches to
    previous = ""  # the last token: "node" (or a number after it), "(" or ")"
    for index, text in enumerate(texts):
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
                raise _error(string, texts, index, fault)
            if text == "(":
                branches.append((node, index))
            else:
                node, _ = branches.pop()
            token_nodes.append(-1)
            token_edges.append(-1)
            previous = text
            continue
        number = number_value(text)
        if number is None:
            raise _error(string, texts, index, _unknown(text, alphabet))
        if previous != "node":
            raise _error(string, texts, index, "a cycle number must follow its node")
        token_nodes.append(node)
        if number not in numbers:
            numbers[number] = (node, index)
            token_edges.append(-1)
            continue
        other, start = numbers.pop(number)
        if other == node:
            raise _error(string, texts, index, f"cycle number {number} leads from a node to itself")
        token_edges[start] = len(ends)
        token_edges.append(len(ends))
        ends.append((other, node))
    if not types:
        raise StringError(string, 0, "the string is empty")
    if branches:
        raise _error(string, texts, branches[-1][1], "the branch is not closed")
    if numbers:
        number, (_, start) = min(numbers.items(), key=lambda item: item[1][1])
        raise _error(string, texts, start, f"cycle number {number} occurs only once")
    return _graph(string, types, ends, texts, token_nodes, token_edges)


def _graph(
    string: str,
    types: list[int],
    ends: list[tuple[int, int]],
    texts: list[str],
    token_nodes: list[int],
    token_edges: list[int],
) -> Decoded:
    """Return the graph with sorted edges. The tokens name edges by their rows in `ends`, lower node first."""
    pairs = np.array(ends, dtype=np.int64).reshape(-1, 2)
    keys = pairs[:, 0] * len(types) + pairs[:, 1]
    order = np.argsort(keys, kind="stable")
    is_double = np.diff(keys[order]) == 0
    if is_double.any():
        later = int(order[1:][is_double].min())
        index = len(token_edges) - 1 - token_edges[::-1].index(later)
        raise _error(string, texts, index, "two edges join the same two nodes")
    row = np.append(np.argsort(order), -1)  # a token without an edge keeps its -1
    return Decoded(
        types=np.array(types, dtype=np.int16),
        edges=pairs[order].astype(np.int32),
        texts=tuple(texts),
        token_nodes=tuple(token_nodes),
        token_edges=tuple(row[token_edges].tolist()),
    )


def _branch_fault(text: str, previous: str, is_inside: bool) -> str:
    """Return what is wrong with a parenthesis after a `previous` token, or an empty text."""
    if text == "(":
        return {"": "a string cannot begin with a branch", "(": "a branch must begin with a node"}.get(previous, "")
    if not is_inside:
        return "no branch is open here"
    return "the branch is empty" if previous == "(" else ""


def _unknown(text: str, alphabet: Alphabet) -> str:
    if text == "%":
        return "% must precede two digits, or a number in parentheses"
    known = ", ".join(alphabet.tokens[:3]) + (f" to {alphabet.tokens[-1]}" if len(alphabet.tokens) > 3 else "")
    return f"unknown token {text!r}; the alphabet is {known}"


def _error(string: str, texts: list[str], index: int, reason: str) -> StringError:
    return StringError(string, sum(map(len, texts[:index])), reason)
