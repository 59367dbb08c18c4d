"""What may take the place of what is at each docking site of an exemplar: the paper's editor, as a list (symmetry §3.2,
§4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.grammars.extraction.extract import Extraction
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
class Option:
    """At the site of a docker, by its place, another one: its place; kind: insert where it holds what it replaces,
    delete where it is held in it, else replace; motion: float64 (4, 4), from where it docks to this site."""

    docker: int
    other: int
    kind: OperationKind
    motion: FloatArray


def options_of(found: Extraction) -> dict[int, list[Option]]:
    """For each docker of the exemplar that is one of its kind at its site what else may dock there, each kind of docker
    once, those of the smallest first."""
    kinds = _kinds(found)
    dockers = found.dockers
    options: dict[int, list[Option]] = {}
    for place, docker in enumerate(dockers):
        seen = {kinds[place]}
        for other, each in enumerate(dockers):
            if each.site == docker.site and kinds[other] not in seen:
                seen.add(kinds[other])
                kind = operation_kind(each.cells, docker.cells, found.grid.slack)
                motion = docker.frame @ invert(each.frame)
                options.setdefault(place, []).append(Option(place, other, kind, motion))
    return options


def edited(found: Extraction, option: Option) -> tuple[Soup, Soup]:
    """The exemplar after an option: what stays, and what has come."""
    grid, dockers, seams = found.grid, found.dockers, found.seams
    whole = Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32))
    old, new = dockers[option.docker], dockers[option.other]
    _, stays = cut_out(whole, grid, old.cells, old.frame, seams[old.site])
    comes, _ = cut_out(whole, grid, new.cells, new.frame, seams[new.site])
    moved = transform_points(option.motion, comes.corners.reshape(-1, 3)).reshape(-1, 3, 3)
    return stays, Soup(moved, comes.faces)


def _kinds(found: Extraction) -> list[int]:
    """For each docker the place of the first that is like it: a motion from site to site takes one onto the other."""
    kinds: list[int] = []
    for place, docker in enumerate(found.dockers):
        known = [each for each in dict.fromkeys(kinds) if found.dockers[each].site == docker.site]
        kinds.append(next((each for each in known if _alike(found, each, place)), place))
    return kinds


def _alike(found: Extraction, one: int, other: int) -> bool:
    first, second = found.dockers[one], found.dockers[other]
    if abs(first.area - second.area) > SAME_AREA * first.area:
        return False
    items = items_in(found.grid, first.cells)
    items = items[np.linspace(0, len(items) - 1, min(SAMPLE, len(items))).astype(np.int64)]
    return bool(matched_items(found.grid, second.frame @ invert(first.frame), items).mean() > ALIKE)
