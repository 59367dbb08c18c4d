"""A context-free grammar of an exemplar: what docks at which sites (symmetry §3.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.grammars.derivation import START_SITE, Derivation, NonTerminal
from stages.grammars.extraction.docked_pieces import DockedPiece, surrounding_cells
from stages.grammars.extraction.seams import Seam, cells_within_steps, make_seam
from stages.grammars.extraction.terminals import Terminal, TerminalCutter
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.cell_lookup import PackedSubset, items_in
from stages.symmetry.matching.r_symmetry import matched_items
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup

MAX_INDEPENDENT_SETS = 10
"""Independent sets of sites that are sampled per docked piece (symmetry §3.4.2)."""
CLEARANCE_STEPS = 2
"""Cells by which a piece must lie inside another one, or away from it."""
MIN_SIZE_DIFFERENCE = 2e-3
"""Share of the surface by which a piece is larger than one in it."""
MIN_MATCHED_SHARE = 0.99
"""Share of the items of a piece that must match those of another for the two to be one terminal."""
MAX_AREA_DIFFERENCE = 1e-3
"""Share of their surface by which equal terminals may differ."""
MAX_BORDER_RATIO = 1.5
"""A piece may differ from its cells by this multiple of the surface around them: its seam follows other cells."""


@dataclass(frozen=True)
class ExtractedProduction:
    """What may replace a non-terminal: a terminal with non-terminals of its own.

    site: class of its site, or START_SITE
    frame: float64 (4, 4), of the site where the exemplar has this piece
    terminal: triangles as in the exemplar
    """

    site: int
    frame: FloatArray
    terminal: Terminal
    non_terminals: tuple[NonTerminal, ...]


def seams_by_site(grid: SurfaceGrid, pieces: Sequence[DockedPiece]) -> dict[int, Seam]:
    """Return the seam of each class of sites."""
    firsts = [piece for piece in pieces if np.array_equal(piece.frame, np.eye(4))]
    return {piece.site: make_seam(grid, piece.border, piece.cells) for piece in reversed(firsts)}


def extract_productions(
    grid: SurfaceGrid, pieces: Sequence[DockedPiece], seams: dict[int, Seam], rng: np.random.Generator
) -> tuple[list[ExtractedProduction], Soup]:
    """Return the productions of an exemplar, those of START_SITE first, and all triangle pieces of their terminals.

    Pieces in a docked piece are its children. Of children that overlap some are chosen, in at most
    MAX_INDEPENDENT_SETS ways, each a production of its own. A child that overlaps chosen ones is replaced by one of its
    own children, one level deep. Productions with equal terminals and non-terminals are one.
    """
    whole = DockedPiece(np.arange(len(grid), dtype=np.int32), np.empty(0, np.int32), 1.0, START_SITE, np.eye(4))
    every = [*pieces, whole]
    inside, disjoint = _relations(grid, every)
    cutter = TerminalCutter(grid, every, seams)
    known: list[tuple[ExtractedProduction, PackedSubset]] = []
    original: dict[int, Derivation] = {}
    # smallest first: the derivation of a piece consists of those of the pieces in it
    for node in np.argsort([piece.area for piece in every], kind="stable").tolist():
        for chosen in _independent_sets(node, inside, disjoint, rng):
            if not all(index in original for index in chosen):
                continue
            left = _rest(grid, every, node, chosen)
            terminal = cutter.between(node, chosen)
            if not len(terminal) or not _fits_cells(grid, terminal, np.flatnonzero(left)):
                continue
            non_terminals = tuple(
                NonTerminal(every[index].site, every[index].frame, original[index]) for index in chosen
            )
            new = (
                ExtractedProduction(every[node].site, every[node].frame, terminal, non_terminals),
                PackedSubset.of(left),
            )
            number, order = len(known), tuple(range(len(non_terminals)))
            for index, candidate in enumerate(known):
                same = _matching_order(grid, candidate, new, seams)
                if same is not None:
                    number, order = index, same
                    break
            else:
                known.append(new)
            # non-terminals of one production lie elsewhere in the exemplar, with other content
            original.setdefault(node, Derivation(number, tuple(non_terminals[index].original for index in order)))
    return _by_site([production for production, _ in known]), cutter.pieces()


def _relations(grid: SurfaceGrid, every: Sequence[DockedPiece]) -> tuple[BoolArray, BoolArray]:
    """Return for each two pieces whether the second lies in the first, and whether they are disjoint, bool (n, n)."""
    count = len(every)
    wide = [cells_within_steps(grid, piece.cells, CLEARANCE_STEPS) for piece in every]
    inside, disjoint = np.zeros((count, count), dtype=bool), np.zeros((count, count), dtype=bool)
    for one, piece in enumerate(every):
        within = np.zeros(len(grid), dtype=bool)
        within[piece.cells] = True
        for other in range(count):
            if other != one:
                smaller = every[other].area < piece.area - MIN_SIZE_DIFFERENCE
                inside[one, other] = smaller and not (wide[other] & ~within).any()
                disjoint[one, other] = not (wide[other] & within).any()
    return inside, disjoint & disjoint.T


def _independent_sets(
    node: int, inside: BoolArray, disjoint: BoolArray, rng: np.random.Generator
) -> list[tuple[int, ...]]:
    """Return at most MAX_INDEPENDENT_SETS different sets of disjoint pieces in docked piece `node`."""
    children = _children(node, inside)
    if not len(children):
        return [()]
    sets: dict[tuple[int, ...], None] = {}
    for first in rng.permutation(children)[:MAX_INDEPENDENT_SETS].tolist():
        chosen = [first]
        others = [child for child in rng.permutation(children).tolist() if child != first]
        left: list[int] = []
        for child in others:
            (chosen if disjoint[child, chosen].all() else left).append(child)
        for child in left:
            chosen += [inner for inner in _children(child, inside).tolist() if disjoint[inner, chosen].all()][:1]
        sets[tuple(sorted(chosen))] = None
    return list(sets)


def _children(node: int, inside: BoolArray) -> np.ndarray:
    """Return the pieces in a docked piece that lie in no other piece in it."""
    within = np.flatnonzero(inside[node])
    children: np.ndarray = within[~inside[np.ix_(within, within)].any(axis=0)]
    return children


def _rest(grid: SurfaceGrid, every: Sequence[DockedPiece], node: int, chosen: tuple[int, ...]) -> BoolArray:
    """Return which cells of a docked piece are in none of the chosen pieces, bool (n,)."""
    left = np.zeros(len(grid), dtype=bool)
    left[every[node].cells] = True
    for index in chosen:
        left[every[index].cells] = False
    return left


def _fits_cells(grid: SurfaceGrid, terminal: Terminal, cells: np.ndarray) -> bool:
    """Return whether a terminal has the area of its cells, apart from the border.

    A seam that was moved here may separate something else where two sheets lie in one cell.
    """
    wanted = float(grid.area[cells].sum())
    border = float(grid.area[surrounding_cells(grid, cells)].sum())
    return abs(terminal.area - wanted) <= MAX_BORDER_RATIO * border + (MAX_AREA_DIFFERENCE + grid.slack) * wanted


def _matching_order(
    grid: SurfaceGrid,
    one: tuple[ExtractedProduction, PackedSubset],
    other: tuple[ExtractedProduction, PackedSubset],
    seams: dict[int, Seam],
) -> tuple[int, ...] | None:
    """Return for each non-terminal of the first production its equal in the second; None if they differ.

    Each production comes with its cells. Equal productions agree in site, non-terminals and terminal.
    """
    (first, cells), (second, others) = one, other
    if first.site != second.site or len(first.non_terminals) != len(second.non_terminals):
        return None
    max_difference = (MAX_AREA_DIFFERENCE + grid.slack) * first.terminal.area
    if abs(first.terminal.area - second.terminal.area) > max_difference:
        return None
    transform = second.frame @ invert(first.frame)
    order: list[int] = []
    for non_terminal in first.non_terminals:
        probe = grid.points[items_in(grid, seams[non_terminal.site].inner)]
        expected = transform_points(transform @ non_terminal.frame, probe)
        same = [
            number
            for number, candidate in enumerate(second.non_terminals)
            if number not in order
            and candidate.site == non_terminal.site
            and np.abs(transform_points(candidate.frame, probe) - expected).max() < grid.cell_size
        ]
        if not same:
            return None
        order.append(same[0])
    matches = all(
        bool(matched_items(grid, way, items_in(grid, held)).mean() > MIN_MATCHED_SHARE * grid.agreement)
        for way, held in ((transform, cells.indices), (invert(transform), others.indices))
    )
    return tuple(order) if matches else None


def _by_site(productions: Sequence[ExtractedProduction]) -> list[ExtractedProduction]:
    """Return the productions in the order of their sites."""
    order = sorted(range(len(productions)), key=lambda index: (productions[index].site, index))
    number = {old: new for new, old in enumerate(order)}

    def renumbered(derivation: Derivation) -> Derivation:
        return Derivation(number[derivation.production], tuple(map(renumbered, derivation.parts)))

    return [
        replace(
            productions[old],
            non_terminals=tuple(
                replace(non_terminal, original=renumbered(non_terminal.original))
                for non_terminal in productions[old].non_terminals
            ),
        )
        for old in order
    ]
