"""A context-free grammar of an exemplar: what docks at which sites (symmetry §3.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.grammars.derivation import START, Derivation, NonTerminal
from stages.grammars.extraction.docked_pieces import DockedPiece, surrounding_cells
from stages.grammars.extraction.seams import Seam, cells_within_steps, make_seam
from stages.grammars.extraction.terminals import Terminal, TerminalCutter
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.cell_lookup import ChosenSet, items_in
from stages.symmetry.matching.r_symmetry import matched_items
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup

SETS = 10
"""Independent sets of sites that are sampled for a docker (symmetry §3.4.2)."""
ROOM = 2
"""Cells by which a docker must lie inside another, or apart from it."""
LEAST = 2e-3
"""Share of the surface by which a docker is larger than one in it."""
ALIKE = 0.99
"""Share of the items of a piece that must have their equals in another for the two to be one terminal."""
SAME_AREA = 1e-3
"""Share of their surface by which terminals that are equal may differ."""
BORDERS = 1.5
"""A piece that is cut out may differ from its cells by so much of what lies around them: a seam follows others."""


@dataclass(frozen=True)
class ExtractedProduction:
    """What may stand at a site: a terminal, and places for others.

    site: its class, or START; frame: float64 (4, 4), of the site where the exemplar has this docker; terminal: its
    triangles as the exemplar has them; places: the non-terminals in it.
    """

    site: int
    frame: FloatArray
    terminal: Terminal
    non_terminals: tuple[NonTerminal, ...]


def seams_by_site(grid: SurfaceGrid, dockers: Sequence[DockedPiece]) -> dict[int, Seam]:
    """The seam of each class of sites."""
    firsts = [each for each in dockers if np.array_equal(each.frame, np.eye(4))]
    return {each.site: make_seam(grid, each.border, each.cells) for each in reversed(firsts)}


def extract_productions(
    grid: SurfaceGrid, dockers: Sequence[DockedPiece], seams: dict[int, Seam], rng: np.random.Generator
) -> tuple[list[ExtractedProduction], Soup]:
    """The productions of an exemplar, those of START first, and all pieces that their terminals may have.

    Dockers that lie in a docker are its children; of those that overlap some are chosen, in at most SETS ways, each a
    production of its own. Of a child that overlaps what is chosen its own children are tried, one level. Productions
    that are equal, terminal and places, are one.
    """
    whole = DockedPiece(np.arange(len(grid), dtype=np.int32), np.empty(0, np.int32), 1.0, START, np.eye(4))
    every = [*dockers, whole]
    inside, apart = _relations(grid, every)
    cuts = TerminalCutter(grid, every, seams)
    found: list[tuple[ExtractedProduction, ChosenSet]] = []
    original: dict[int, Derivation] = {}
    # smallest first: what gives a docker back is made of what gives those in it back
    for node in np.argsort([each.area for each in every], kind="stable").tolist():
        for chosen in _independent(node, inside, apart, rng):
            if not all(each in original for each in chosen):
                continue
            left = _rest(grid, every, node, chosen)
            terminal = cuts.between(node, chosen)
            if not len(terminal) or not _faithful(grid, terminal, np.flatnonzero(left)):
                continue
            places = tuple(NonTerminal(every[each].site, every[each].frame, original[each]) for each in chosen)
            made = ExtractedProduction(every[node].site, every[node].frame, terminal, places), ChosenSet.of(left)
            known, order = len(found), tuple(range(len(places)))
            for number, each in enumerate(found):
                same = _equal(grid, each, made, seams)
                if same is not None:
                    known, order = number, same
                    break
            else:
                found.append(made)
            # places of one production lie elsewhere in the exemplar, with other things in them
            original.setdefault(node, Derivation(known, tuple(places[each].original for each in order)))
    return _by_site([each for each, _ in found]), cuts.pieces()


def _relations(grid: SurfaceGrid, every: Sequence[DockedPiece]) -> tuple[BoolArray, BoolArray]:
    """Of each two dockers whether the second lies in the first, and whether they lie apart, bool (n, n) each."""
    count = len(every)
    wide = [cells_within_steps(grid, each.cells, ROOM) for each in every]
    inside, apart = np.zeros((count, count), dtype=bool), np.zeros((count, count), dtype=bool)
    for one, docker in enumerate(every):
        within = np.zeros(len(grid), dtype=bool)
        within[docker.cells] = True
        for other in range(count):
            if other != one:
                inside[one, other] = every[other].area < docker.area - LEAST and not (wide[other] & ~within).any()
                apart[one, other] = not (wide[other] & within).any()
    return inside, apart & apart.T


def _independent(node: int, inside: BoolArray, apart: BoolArray, rng: np.random.Generator) -> list[tuple[int, ...]]:
    """Sets of dockers in docker `node` that lie apart from each other, different ones, at most SETS."""
    children = _direct(node, inside)
    if not len(children):
        return [()]
    found: dict[tuple[int, ...], None] = {}
    for first in rng.permutation(children)[:SETS].tolist():
        chosen = [first]
        others = [each for each in rng.permutation(children).tolist() if each != first]
        left: list[int] = []
        for each in others:
            (chosen if apart[each, chosen].all() else left).append(each)
        for each in left:
            chosen += [one for one in _direct(each, inside).tolist() if apart[one, chosen].all()][:1]
        found[tuple(sorted(chosen))] = None
    return list(found)


def _direct(node: int, inside: BoolArray) -> np.ndarray:
    """The dockers in a docker that lie in no other one in it."""
    within = np.flatnonzero(inside[node])
    found: np.ndarray = within[~inside[np.ix_(within, within)].any(axis=0)]
    return found


def _rest(grid: SurfaceGrid, every: Sequence[DockedPiece], node: int, chosen: tuple[int, ...]) -> BoolArray:
    """Which cells are of a docker and in none of those chosen in it, bool (n,)."""
    left = np.zeros(len(grid), dtype=bool)
    left[every[node].cells] = True
    for each in chosen:
        left[every[each].cells] = False
    return left


def _faithful(grid: SurfaceGrid, terminal: Terminal, cells: np.ndarray) -> bool:
    """Whether triangles that were cut out are those of some cells, but for the border: a seam that moved here may part
    something else where sheets lie in one cell."""
    wanted = float(grid.area[cells].sum())
    border = float(grid.area[surrounding_cells(grid, cells)].sum())
    return abs(terminal.area - wanted) <= BORDERS * border + (SAME_AREA + grid.slack) * wanted


def _equal(
    grid: SurfaceGrid,
    one: tuple[ExtractedProduction, ChosenSet],
    other: tuple[ExtractedProduction, ChosenSet],
    seams: dict[int, Seam],
) -> tuple[int, ...] | None:
    """Whether two productions, each with its cells, are equal in their sites, their places, and what is left: for each
    place of the first which of the second it is, None where they are not."""
    (first, cells), (second, others) = one, other
    if first.site != second.site or len(first.non_terminals) != len(second.non_terminals):
        return None
    if abs(first.terminal.area - second.terminal.area) > (SAME_AREA + grid.slack) * first.terminal.area:
        return None
    motion = second.frame @ invert(first.frame)
    order: list[int] = []
    for place in first.non_terminals:
        probe = grid.points[items_in(grid, seams[place.site].inner)]
        want = transform_points(motion @ place.frame, probe)
        same = [
            number
            for number, each in enumerate(second.non_terminals)
            if number not in order
            and each.site == place.site
            and np.abs(transform_points(each.frame, probe) - want).max() < grid.cell_size
        ]
        if not same:
            return None
        order.append(same[0])
    alike = all(
        bool(matched_items(grid, way, items_in(grid, held)).mean() > ALIKE * grid.agreement)
        for way, held in ((motion, cells.indices), (invert(motion), others.indices))
    )
    return tuple(order) if alike else None


def _by_site(found: Sequence[ExtractedProduction]) -> list[ExtractedProduction]:
    """The productions in the order of their sites."""
    order = sorted(range(len(found)), key=lambda place: (found[place].site, place))
    number = {old: new for new, old in enumerate(order)}

    def renumbered(each: Derivation) -> Derivation:
        return Derivation(number[each.production], tuple(map(renumbered, each.parts)))

    return [
        replace(
            found[old],
            non_terminals=tuple(replace(each, original=renumbered(each.original)) for each in found[old].non_terminals),
        )
        for old in order
    ]
