"""What may replace the piece at each docking site: the paper's editor, as a list (symmetry §3.2, §4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.extraction.seams import cut_out
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.cell_lookup import items_in
from stages.symmetry.matching.docking_sites import OperationKind, operation_kind
from stages.symmetry.matching.r_symmetry import matched_items
from stages.symmetry.surface.soup import Soup

SAMPLE_ITEMS = 200
"""Items of a docked piece that are compared with another one."""
MIN_MATCHED_SHARE = 0.995
"""Share of them that must match."""
MAX_AREA_DIFFERENCE = 2e-3
"""Share of their surface by which equal pieces may differ."""


@dataclass(frozen=True)
class EditingOption:
    """A docked piece that may replace another one.

    replaced, other: indices of the piece at the site and of its replacement
    kind: insert where the other contains what it replaces, delete where it is contained in it, else replace
    transform: float64 (4, 4), from where the other docks to this site
    """

    replaced: int
    other: int
    kind: OperationKind
    transform: FloatArray


def editing_options(extracted: ExtractedGrammar) -> dict[int, list[EditingOption]]:
    """Return what else may dock at the site of each distinct piece, each kind once, the smallest first."""
    kinds = _kinds(extracted)
    pieces = extracted.docked_pieces
    options: dict[int, list[EditingOption]] = {}
    for index, piece in enumerate(pieces):
        seen = {kinds[index]}
        for other, candidate in enumerate(pieces):
            if candidate.site == piece.site and kinds[other] not in seen:
                seen.add(kinds[other])
                kind = operation_kind(candidate.cells, piece.cells, extracted.grid.slack)
                transform = piece.frame @ invert(candidate.frame)
                options.setdefault(index, []).append(EditingOption(index, other, kind, transform))
    return options


def apply_option(extracted: ExtractedGrammar, option: EditingOption) -> tuple[Soup, Soup]:
    """Return the exemplar after an option: the triangles that stay, and those that are new."""
    grid, pieces, seams = extracted.grid, extracted.docked_pieces, extracted.seams
    whole = Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32))
    old, new = pieces[option.replaced], pieces[option.other]
    _, stays = cut_out(whole, grid, old.cells, old.frame, seams[old.site])
    comes, _ = cut_out(whole, grid, new.cells, new.frame, seams[new.site])
    moved = transform_points(option.transform, comes.corners.reshape(-1, 3)).reshape(-1, 3, 3)
    return stays, Soup(moved, comes.faces)


def _kinds(extracted: ExtractedGrammar) -> list[int]:
    """Return for each docked piece the index of the first that equals it under the transform from site to site."""
    kinds: list[int] = []
    for index, piece in enumerate(extracted.docked_pieces):
        known = [kind for kind in dict.fromkeys(kinds) if extracted.docked_pieces[kind].site == piece.site]
        kinds.append(next((kind for kind in known if _equal(extracted, kind, index)), index))
    return kinds


def _equal(extracted: ExtractedGrammar, one: int, other: int) -> bool:
    first, second = extracted.docked_pieces[one], extracted.docked_pieces[other]
    if abs(first.area - second.area) > MAX_AREA_DIFFERENCE * first.area:
        return False
    items = items_in(extracted.grid, first.cells)
    items = items[np.linspace(0, len(items) - 1, min(SAMPLE_ITEMS, len(items))).astype(np.int64)]
    matched = matched_items(extracted.grid, second.frame @ invert(first.frame), items)
    return bool(matched.mean() > MIN_MATCHED_SHARE)
