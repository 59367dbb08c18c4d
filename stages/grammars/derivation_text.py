"""Derivations as text, which is what a sample holds: `S1(B1(B0))` or `G1[5,4]`."""

from __future__ import annotations

import re

import numpy as np

from stages.grammars.derivation import START_SITE, Derivation, ResizedGrid
from stages.grammars.grammar import ShapeGrammar

MAX_PIECES = 100_000
"""Pieces of one shape."""
MAX_DEPTH = 800
"""Productions within one another."""


class DerivationError(ValueError):
    """A text that is no derivation of a grammar; the message shows where."""


def format_derivation(grammar: ShapeGrammar, derivation: Derivation | ResizedGrid) -> str:
    """Return the text of a derivation."""
    if isinstance(derivation, ResizedGrid):
        return f"{grammar.grids[derivation.grid].name}[{','.join(map(str, derivation.counts))}]"
    inner = ",".join(format_derivation(grammar, part) for part in derivation.parts)
    return grammar.productions[derivation.production].name + (f"({inner})" if inner else "")


def parse_derivation(grammar: ShapeGrammar, text: str) -> Derivation | ResizedGrid:
    """Return the derivation of a text. Raises DerivationError for a text that the grammar cannot have written."""
    grid = re.fullmatch(r"([A-Za-z0-9_]+)\[(\d+(?:,\d+)*)\]", text, re.ASCII)
    if grid is None:
        return _DerivationParser(grammar, text).whole()
    names = [known.name for known in grammar.grids]
    if grid[1] not in names:
        raise DerivationError(f"{text!r}: grammar {grammar.name} has no grid {grid[1]}; it has {', '.join(names)}")
    index = names.index(grid[1])
    counts = tuple(int(number) for number in grid[2].split(",") if len(number) < 7)
    rows = len(grammar.grids[index].counts)
    if len(counts) != rows or np.prod([count + 2.0 for count in counts]) > MAX_PIECES:
        raise DerivationError(
            f"{text!r}: {grid[1]} takes {rows} numbers of cells that make at most {MAX_PIECES:,} pieces"
        )
    return ResizedGrid(index, counts)


class _DerivationParser:
    """Reads a text from left to right."""

    def __init__(self, grammar: ShapeGrammar, text: str) -> None:
        self._grammar, self._text, self._at = grammar, text, 0
        self._numbers = {production.name: number for number, production in enumerate(grammar.productions)}

    def whole(self) -> Derivation:
        derivation = self._production(START_SITE, 0)
        if self._at < len(self._text):
            raise self._error("the derivation ends here")
        return derivation

    def _production(self, site: int, depth: int) -> Derivation:
        name = re.compile(r"[A-Za-z0-9_]*", re.ASCII).match(self._text, self._at)
        begin, word = self._at, name[0] if name else ""
        number = self._numbers.get(word)
        if number is None or self._grammar.productions[number].site != site or depth > MAX_DEPTH:
            known = self._grammar.productions_of_site.get(site, ())
            names = ", ".join(self._grammar.productions[index].name for index in known)
            raise self._error(f"expected one of {names}")
        self._at = begin + len(word)
        parts: list[Derivation] = []
        for non_terminal in self._grammar.productions[number].non_terminals:
            self._expect("," if parts else "(")
            parts.append(self._production(non_terminal.site, depth + 1))
        if parts:
            self._expect(")")
        return Derivation(number, tuple(parts))

    def _expect(self, sign: str) -> None:
        if self._text[self._at : self._at + 1] != sign:
            raise self._error(f"expected {sign!r}")
        self._at += 1

    def _error(self, why: str) -> DerivationError:
        begin = max(0, self._at - 30)
        excerpt, caret = self._text[begin : self._at + 30], " " * (self._at - begin) + "^"
        return DerivationError(f"at {self._at} of a derivation of {self._grammar.name}: {why}\n{excerpt}\n{caret}")
