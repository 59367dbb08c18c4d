"""Exchanges of parts that the neighbourhoods of a model allow (symmetry §3.3, strings §3)."""

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

MAX_PIECE_SHARE = 0.5
"""Of the surface; a larger exchange is one of the rest."""
MAX_REGION_SETS = 4096
"""Sets of regions tried for a transform, from each start region."""


@dataclass(frozen=True, eq=False)
class Exchange:
    """An exchange of parts."""

    removed: BoolArray
    """Parts that leave, bool (n,)."""
    piece: BoolArray
    """Parts whose copies are added, bool (n,)."""
    transform: FloatArray
    """Of the copies, float64 (4, 4)."""


def known_exchanges(kit: Kit) -> list[Exchange]:
    """Return the elementary exchanges of the first exemplar of a kit (symmetry §3.3).

    Parts take the role of points, and neighbours that of the radius. A transform that keeps up and aligns equal parts
    leaves regions of unaligned parts. An exchange is a minimal set of regions that can change places so that the kit's
    grammar admits every neighbourhood. An exchange and its inverse are one. Pieces of more than half of the surface
    are left out.
    """
    assembly = kit.exemplars[0].whole
    graph = contact_graph(kit, assembly, np.zeros((len(assembly.edges), 2), dtype=np.int32))
    moves = find_region_swaps(kit, {"y": 1, "z": 2}[kit.up], (assembly, graph), (assembly, graph))
    area = _areas(kit, assembly)
    exchanges: dict[frozenset[bytes], Exchange] = {}
    for motion in range(len(moves.transforms)):
        for chosen in _elementary(kit, assembly, moves, motion):
            move = moves.along(motion, chosen)
            pair = move.taken, move.piece
            if max(area[parts].sum() for parts in pair) <= MAX_PIECE_SHARE and (pair[0] != pair[1]).any():
                exchanges.setdefault(frozenset(parts.tobytes() for parts in pair), Exchange(*pair, move.transform))
    return list(exchanges.values())


def _areas(kit: Kit, assembly: Assembly) -> FloatArray:
    """Return the share of the surface of each part, float64 (n,)."""
    corners = [kit.types[kind].vertices[kit.types[kind].faces] for kind in assembly.types.tolist()]
    areas = np.array([triangle_areas(part).sum() for part in corners])
    shares: FloatArray = areas / areas.sum()
    return shares


def _elementary(kit: Kit, assembly: Assembly, swaps: RegionSwaps, transform: int) -> Iterator[BoolArray]:
    """Yield the minimal sets of regions of a transform that can change places, by region, bool (n + n,)."""
    regions, neighbours = swaps.regions[transform], assembly.neighbours()
    count = len(assembly)
    every = frozenset(np.unique(regions[regions >= 0]).tolist())
    aligned = []  # a part that stays; its neighbours, which may leave; and the neighbours that may be added
    for other, part in enumerate(swaps.images[transform].tolist()):
        if part >= 0:
            own = [(int(regions[neighbour]), neighbour) for neighbour in neighbours[part]]
            new = [(int(regions[count + neighbour]), neighbour) for neighbour in neighbours[other]]
            aligned.append((part, own, [pair for pair in new if pair[0] >= 0]))

    def around_misfit(chosen: frozenset[int]) -> frozenset[int]:
        """Return the regions around the first part without an admitted neighbourhood; none if all have one."""
        for part, own, new in aligned:
            around = frozenset(region for region, _ in (*own, *new) if region >= 0)
            kept = [neighbour for region, neighbour in own if region not in chosen]
            added = [neighbour for region, neighbour in new if region in chosen]
            if around and not admits(kit.grammar, int(assembly.types[part]), assembly.multiset(kept + added)):
                return around
        return frozenset()

    minimal: list[frozenset[int]] = []
    for first in sorted(every):
        queue, seen = [frozenset([first])], {frozenset([first])}
        for chosen in queue:  # grows; smaller sets come first
            if any(smaller <= chosen for smaller in minimal) or chosen == every or len(queue) > MAX_REGION_SETS:
                continue
            around = around_misfit(chosen)
            if not around:
                minimal.append(chosen)
            larger = [chosen | {region} for region in sorted(around - chosen)]
            queue += [regions_set for regions_set in larger if regions_set not in seen]
            seen.update(larger)
    for chosen in minimal:
        if not any(smaller < chosen for smaller in minimal):
            yield np.isin(np.arange(len(regions)), list(chosen))
