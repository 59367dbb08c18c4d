"""What may take the place of what is at each docking site of an exemplar: the paper's editor, as a list (symmetry §3.2,
§4.2)."""

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

SAMPLE = 200
"""Items of a docker that are looked at to see whether another one is like it."""
ALIKE = 0.995
"""Share of them that must have their equals."""
SAME_AREA = 2e-3
"""Share of their surface by which dockers that are alike may differ."""


@dataclass(frozen=True)
class EditingOption:
    """At the site of a docker, by its place, another one: its place; kind: insert where it holds what it replaces,
    delete where it is held in it, else replace; motion: float64 (4, 4), from where it docks to this site."""

    docker: int
    other: int
    kind: OperationKind
    transform: FloatArray


def editing_options(found: ExtractedGrammar) -> dict[int, list[EditingOption]]:
    """For each docker of the exemplar that is one of its kind at its site what else may dock there, each kind of docker
    once, those of the smallest first."""
    kinds = _kinds(found)
    dockers = found.docked_pieces
    options: dict[int, list[EditingOption]] = {}
    for place, docker in enumerate(dockers):
        seen = {kinds[place]}
        for other, each in enumerate(dockers):
            if each.site == docker.site and kinds[other] not in seen:
                seen.add(kinds[other])
                kind = operation_kind(each.cells, docker.cells, found.grid.slack)
                motion = docker.frame @ invert(each.frame)
                options.setdefault(place, []).append(EditingOption(place, other, kind, motion))
    return options


def apply_option(found: ExtractedGrammar, option: EditingOption) -> tuple[Soup, Soup]:
    """The exemplar after an option: what stays, and what has come."""
    grid, dockers, seams = found.grid, found.docked_pieces, found.seams
    whole = Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32))
    old, new = dockers[option.docker], dockers[option.other]
    _, stays = cut_out(whole, grid, old.cells, old.frame, seams[old.site])
    comes, _ = cut_out(whole, grid, new.cells, new.frame, seams[new.site])
    moved = transform_points(option.transform, comes.corners.reshape(-1, 3)).reshape(-1, 3, 3)
    return stays, Soup(moved, comes.faces)


def _kinds(found: ExtractedGrammar) -> list[int]:
    """For each docker the place of the first that is like it: a motion from site to site takes one onto the other."""
    kinds: list[int] = []
    for place, docker in enumerate(found.docked_pieces):
        known = [each for each in dict.fromkeys(kinds) if found.docked_pieces[each].site == docker.site]
        kinds.append(next((each for each in known if _alike(found, each, place)), place))
    return kinds


def _alike(found: ExtractedGrammar, one: int, other: int) -> bool:
    first, second = found.docked_pieces[one], found.docked_pieces[other]
    if abs(first.area - second.area) > SAME_AREA * first.area:
        return False
    items = items_in(found.grid, first.cells)
    items = items[np.linspace(0, len(items) - 1, min(SAMPLE, len(items))).astype(np.int64)]
    return bool(matched_items(found.grid, second.frame @ invert(first.frame), items).mean() > ALIKE)
