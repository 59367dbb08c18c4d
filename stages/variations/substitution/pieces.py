"""What is taken out and what replaces it: parts of some labels that touch each other, all of them or one group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import TypeArray
from stages.shape.kit import Assembly

ALL_GROUPS_PROBABILITY = 0.75
"""Probability that all groups of the chosen parts are exchanged together, such as four legs that only the seat joins.
"""

Chosen = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Exchanged:
    """The parts that a substitution or replacement exchanges."""

    taken: Chosen  # bool (n,), parts of the base that leave
    piece: Chosen  # bool (m,), parts of the giver that come


def draw_pieces(rng: np.random.Generator, base: Assembly, giver: Assembly) -> Exchanged | None:
    """Draw parts of random labels that touch each other somewhere in the two shapes, whose types are labels here.

    `taken` may be empty: then something is added. None where nothing would come, or nothing of the base or giver would
        stay.
    """
    labels = _draw_labels(rng, base, giver)
    taken, piece = np.isin(base.types, labels), np.isin(giver.types, labels)
    if rng.random() >= ALL_GROUPS_PROBABILITY:
        taken, piece = _one_group(rng, base, taken), _one_group(rng, giver, piece)
    if not piece.any() or piece.all() or taken.all():
        return None
    return Exchanged(taken, piece)


def _draw_labels(rng: np.random.Generator, base: Assembly, giver: Assembly) -> TypeArray:
    """Draw labels of the two shapes, grown from a random one along contacts."""
    present = np.union1d(base.types, giver.types)
    edges = np.concatenate([base.types[base.edges], giver.types[giver.edges]])
    chosen = present[[int(rng.random() * len(present))]]
    for _ in range(int(rng.random() * max(len(present) - 1, 1))):
        ends = np.isin(edges, chosen)
        adjacent = np.setdiff1d(edges[ends.any(axis=1)], chosen)
        if not len(adjacent):
            break
        chosen = np.append(chosen, adjacent[int(rng.random() * len(adjacent))])
    return chosen


def _one_group(rng: np.random.Generator, assembly: Assembly, chosen: Chosen) -> Chosen:
    """Return one of the connected groups of the chosen parts, at random."""
    if not chosen.any():
        return chosen
    parts = np.flatnonzero(chosen)
    neighbours = assembly.neighbours()
    waiting = [int(parts[int(rng.random() * len(parts))])]
    group = np.zeros_like(chosen)
    while waiting:
        part = waiting.pop()
        if not group[part]:
            group[part] = True
            waiting.extend(neighbour for neighbour in neighbours[part] if chosen[neighbour])
    return group
