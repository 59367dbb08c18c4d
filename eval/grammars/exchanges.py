"""What may take each other's place in a model by its parts (symmetry §3.3, strings §3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.graphs.neighbourhoods import admits
from stages.shape.kit import Assembly, Kit
from stages.variations.substructures.alignments import find_region_swaps
from stages.variations.substructures.docking_sites import contact_graph
from stages.variations.substructures.region_swaps import RegionSwaps

LARGEST = 0.5
"""Share of the surface that a piece has at most: to exchange more is to exchange the rest."""
TRIED = 4096
"""Sets of regions that are tried along a motion, from each region on."""


@dataclass(frozen=True, eq=False)
class Exchange:
    """An exchange by parts: which leave and which come, bool (n,) each, and what brings those, float64 (4, 4)."""

    taken: BoolArray
    piece: BoolArray
    motion: FloatArray


def known_exchanges(kit: Kit) -> list[Exchange]:
    """What may take each other's place in the first exemplar of a kit: elementary docking sites (symmetry §3.3), of
    parts in place of points and of their neighbours in place of the radius.

    Each motion that keeps what points up and lays some part upon an equal one leaves regions of parts that it does not
    lay upon equal ones. As few regions change places at once as it takes for every part to have a neighbourhood that
    the kit's grammar admits. An exchange and the one back are one. Pieces of more than half of the surface are left
    out.
    """
    assembly = kit.exemplars[0].whole
    graph = contact_graph(kit, assembly, np.zeros((len(assembly.edges), 2), dtype=np.int32))
    moves = find_region_swaps(kit, {"y": 1, "z": 2}[kit.up], (assembly, graph), (assembly, graph))
    area = _areas(kit, assembly)
    found: dict[frozenset[bytes], Exchange] = {}
    for motion in range(len(moves.motions)):
        for chosen in _elementary(kit, assembly, moves, motion):
            move = moves.along(motion, chosen)
            pair = move.taken, move.piece
            if max(area[each].sum() for each in pair) <= LARGEST and (pair[0] != pair[1]).any():
                found.setdefault(frozenset(each.tobytes() for each in pair), Exchange(*pair, move.motion))
    return list(found.values())


def _areas(kit: Kit, assembly: Assembly) -> FloatArray:
    """Share of the surface that each part has, float64 (n,)."""
    corners = [kit.types[each].vertices[kit.types[each].faces] for each in assembly.types.tolist()]
    areas = np.array([triangle_areas(part).sum() for part in corners])
    shares: FloatArray = areas / areas.sum()
    return shares


def _elementary(kit: Kit, assembly: Assembly, moves: RegionSwaps, motion: int) -> Iterator[BoolArray]:
    """The least sets of regions along a motion that can change places, by their numbers, bool (n + n,)."""
    regions, near = moves.regions[motion], assembly.neighbours()
    count = len(assembly)
    every = frozenset(np.unique(regions[regions >= 0]).tolist())
    between = []  # a part that stays, what is beside it that may leave or stay, and that may come
    for other, part in enumerate(moves.images[motion].tolist()):
        if part >= 0:
            between.append(
                (
                    part,
                    [(int(regions[each]), each) for each in near[part]],
                    [(int(regions[count + each]), each) for each in near[other] if regions[count + each] >= 0],
                )
            )

    def beside_misfit(chosen: frozenset[int]) -> frozenset[int]:
        """The regions beside the first part that would have a neighbourhood that is not admitted; none if all have."""
        for part, own, new in between:
            around = frozenset(region for region, _ in (*own, *new) if region >= 0)
            left = [each for region, each in own if region not in chosen]
            come = [each for region, each in new if region in chosen]
            if around and not admits(kit.grammar, int(assembly.types[part]), assembly.multiset(left + come)):
                return around
        return frozenset()

    least: list[frozenset[int]] = []
    for first in sorted(every):
        waiting, seen = [frozenset([first])], {frozenset([first])}
        for chosen in waiting:  # grows; the smaller sets come first
            if any(each <= chosen for each in least) or chosen == every or len(waiting) > TRIED:
                continue
            around = beside_misfit(chosen)
            if not around:
                least.append(chosen)
            more = [chosen | {each} for each in sorted(around - chosen)]
            waiting += [each for each in more if each not in seen]
            seen.update(more)
    for chosen in least:
        if not any(each < chosen for each in least):
            yield np.isin(np.arange(len(regions)), list(chosen))
