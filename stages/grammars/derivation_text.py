"""What a sample of a grammar says, `S1(B1(B0))` or `G1[5,4]`, and the pieces that it puts where."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derivation import START, Derivation, grid_poses
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.kit import Assembly
from stages.shape.shape import Shape

DIGITS = 5
"""Moments of shapes that agree to so many decimals are one."""
MOST = 100_000
"""Pieces of one shape."""
DEEPEST = 800
"""Productions within one another."""


class DerivationError(ValueError):
    """A text that is no derivation of a grammar; the message shows where."""


@dataclass(frozen=True)
class ResizedGrid:
    """A grid with so many cells along each of its rows."""

    grid: int
    counts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class PlacedTerminal:
    """A mesh of a grammar at a pose (4, 4)."""

    mesh: int
    pose: FloatArray


def format_derivation(grammar: ShapeGrammar, made: Derivation | ResizedGrid) -> str:
    """The text of a derivation."""
    if isinstance(made, ResizedGrid):
        return f"{grammar.grids[made.grid].name}[{','.join(map(str, made.counts))}]"
    inner = ",".join(format_derivation(grammar, each) for each in made.parts)
    return grammar.productions[made.production].name + (f"({inner})" if inner else "")


def parse_derivation(grammar: ShapeGrammar, text: str) -> Derivation | ResizedGrid:
    """The derivation of a text. Raises DerivationError for one that the grammar cannot have written."""
    grid = re.fullmatch(r"([A-Za-z0-9_]+)\[(\d+(?:,\d+)*)\]", text, re.ASCII)
    if grid is None:
        return _Reader(grammar, text).whole()
    names = [each.name for each in grammar.grids]
    if grid[1] not in names:
        raise DerivationError(f"{text!r}: grammar {grammar.name} has no grid {grid[1]}; it has {', '.join(names)}")
    place = names.index(grid[1])
    counts = tuple(int(each) for each in grid[2].split(",") if len(each) < 7)
    rows = len(grammar.grids[place].counts)
    if len(counts) != rows or np.prod([each + 2.0 for each in counts]) > MOST:
        raise DerivationError(
            f"{text!r}: {grid[1]} takes {rows} numbers of cells, and at most {MOST:,} pieces come of it"
        )
    return ResizedGrid(place, counts)


class _Reader:
    """Reads a text from left to right."""

    def __init__(self, grammar: ShapeGrammar, text: str) -> None:
        self._grammar, self._text, self._at = grammar, text, 0
        self._named = {each.name: number for number, each in enumerate(grammar.productions)}

    def whole(self) -> Derivation:
        found = self._production(START, 0)
        if self._at < len(self._text):
            raise self._error("the derivation is at its end here")
        return found

    def _production(self, site: int, depth: int) -> Derivation:
        name = re.compile(r"[A-Za-z0-9_]*", re.ASCII).match(self._text, self._at)
        begin, word = self._at, name[0] if name else ""
        number = self._named.get(word)
        if number is None or self._grammar.productions[number].site != site or depth > DEEPEST:
            known = ", ".join(
                self._grammar.productions[each].name for each in self._grammar.productions_of_site.get(site, ())
            )
            raise self._error(f"one of {known} must stand here")
        self._at = begin + len(word)
        parts: list[Derivation] = []
        for place in self._grammar.productions[number].non_terminals:
            self._expect("," if parts else "(")
            parts.append(self._production(place.site, depth + 1))
        if parts:
            self._expect(")")
        return Derivation(number, tuple(parts))

    def _expect(self, sign: str) -> None:
        if self._text[self._at : self._at + 1] != sign:
            raise self._error(f"{sign!r} must stand here")
        self._at += 1

    def _error(self, why: str) -> DerivationError:
        begin = max(0, self._at - 30)
        shown = self._text[begin : self._at + 30]
        return DerivationError(
            f"at {self._at} of a derivation of {self._grammar.name}: {why}\n{shown}\n{'^':>{self._at - begin + 1}}"
        )


def placed_terminals(grammar: ShapeGrammar, made: Derivation | ResizedGrid) -> list[PlacedTerminal]:
    """The pieces of a derivation, each where it stands."""
    if isinstance(made, ResizedGrid):
        grid = grammar.grids[made.grid]
        along = [where for _, where in grid.pieces]
        placed = grid_poses(grid.transforms, grid.counts, along, made.counts)
        return [
            PlacedTerminal(grid.pieces[number][0], grammar.standing(grid.pieces[number][0], pose))
            for number, pose in placed
        ]
    found: list[PlacedTerminal] = []
    waiting = [(made, np.eye(4))]
    while waiting:
        here, motion = waiting.pop()
        rule = grammar.productions[here.production]
        found.append(PlacedTerminal(rule.terminal, grammar.standing(rule.terminal, motion)))
        for place, part in zip(reversed(rule.non_terminals), reversed(here.parts), strict=True):
            child = grammar.productions[part.production]
            waiting.append((part, motion @ place.frame @ invert(child.frame)))
    return found


def shape_of_text(grammar: ShapeGrammar, text: str) -> Shape:
    """The shape of a text, with all meshes of the grammar, so that what is known of them serves all of its shapes.
    Raises DerivationError for a text that is no derivation of the grammar."""
    pieces = placed_terminals(grammar, parse_derivation(grammar, text))
    return _shape(grammar, pieces, np.arange(len(grammar.meshes)))


def compact_shape_of_text(grammar: ShapeGrammar, text: str) -> Shape:
    """The shape of a text, with no more meshes than stand in it: all that a grammar makes as they are asked for are
    gigabytes. Raises DerivationError for a text that is no derivation of the grammar."""
    pieces = placed_terminals(grammar, parse_derivation(grammar, text))
    return _shape(grammar, pieces, np.unique([each.mesh for each in pieces]))


def _shape(grammar: ShapeGrammar, pieces: Sequence[PlacedTerminal], meshes: np.ndarray) -> Shape:
    """The shape of some pieces, with the meshes at these places, int64 (k,) ascending."""
    types = np.searchsorted(meshes, [each.mesh for each in pieces]).astype(np.int16)
    poses = np.array([each.pose for each in pieces])
    chosen = tuple(grammar.meshes[each] for each in meshes.tolist())
    parts = Assembly(types, poses, np.empty((0, 2), np.int32))
    return Shape(chosen, parts, grammar.up, grammar.labels, one_surface=True)


def exemplar_shape(grammar: ShapeGrammar) -> Shape:
    """The exemplar, as one part."""
    alone = Assembly(np.zeros(1, dtype=np.int16), np.eye(4)[None], np.empty((0, 2), np.int32))
    return Shape((grammar.exemplar,), alone, grammar.up, (grammar.exemplar.name,), one_surface=True)


def surface_digest(grammar: ShapeGrammar, pieces: list[PlacedTerminal]) -> str:
    """A hex digest of the surface that pieces make, equal for shapes that a rigid motion, or a mirror, takes to each
    other however they are cut: of its area and of moments up to the fourth, which are sums over triangles."""
    corners = np.concatenate(
        [
            transform_points(each.pose, grammar.meshes[each.mesh].vertices)[grammar.meshes[each.mesh].faces]
            for each in pieces
        ]
    )
    areas = triangle_areas(corners)
    area = float(areas.sum())
    weight = (areas[:, None] * _WEIGHTS).reshape(-1) / area
    points = np.einsum("qk,tkd->tqd", _POINTS, corners).reshape(-1, 3)
    points = (points - weight @ points) / np.sqrt(area)
    squared = (points**2).sum(axis=1)
    own = grammar.exemplar.vertices[grammar.exemplar.faces]
    whole = triangle_areas(own).sum()
    moments = [
        area / whole,
        *np.linalg.eigvalsh((points * weight[:, None]).T @ points),
        float(np.linalg.norm(weight * squared @ points)),
        float(weight @ squared**2),
    ]
    rounded = [f"{each + 0.0:.{DIGITS}f}" for each in moments]
    return hashlib.sha256(" ".join(rounded).encode()).hexdigest()


_A, _B = 0.445948490915965, 0.091576213509771
_POINTS = np.array([np.roll([1 - 2 * a, a, a], k) for a in (_A, _B) for k in range(3)])
"""Barycentric points at which polynomials up to the fourth degree are integrated exactly over a triangle."""
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)
