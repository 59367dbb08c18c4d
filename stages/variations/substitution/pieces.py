"""What is taken out and what is put in its place: the parts of some labels that touch each other, all or one group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import TypeArray
from stages.shape.kit import Assembly

ALL_GROUPS = 0.75
"""How likely all groups of the chosen parts are exchanged together: four legs, which only the seat joins."""

Chosen = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Exchanged:
    """taken: bool (n,), the parts of the base that leave; piece: bool (m,), the parts of the giver that come."""

    taken: Chosen
    piece: Chosen


def draw_pieces(rng: np.random.Generator, base: Assembly, giver: Assembly) -> Exchanged | None:
    """Parts of random labels that touch each other somewhere in the two shapes, whose types are labels here. `taken`
    may be empty: then something is added. None where nothing would come, or nothing of the base or the giver stay."""
    labels = _draw_labels(rng, base, giver)
    taken, piece = np.isin(base.types, labels), np.isin(giver.types, labels)
    if rng.random() >= ALL_GROUPS:
        taken, piece = _one_group(rng, base, taken), _one_group(rng, giver, piece)
    if not piece.any() or piece.all() or taken.all():
        return None
    return Exchanged(taken, piece)


def _draw_labels(rng: np.random.Generator, base: Assembly, giver: Assembly) -> TypeArray:
    """Labels of the two shapes, grown from a random one along contacts."""
    present = np.union1d(base.types, giver.types)
    edges = np.concatenate([base.types[base.edges], giver.types[giver.edges]])
    chosen = present[[int(rng.random() * len(present))]]
    for _ in range(int(rng.random() * max(len(present) - 1, 1))):
        ends = np.isin(edges, chosen)
        beside = np.setdiff1d(edges[ends.any(axis=1)], chosen)
        if not len(beside):
            break
        chosen = np.append(chosen, beside[int(rng.random() * len(beside))])
    return chosen


def _one_group(rng: np.random.Generator, assembly: Assembly, chosen: Chosen) -> Chosen:
    """One of the connected groups of the chosen parts, at random."""
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
            waiting.extend(each for each in neighbours[part] if chosen[each])
    return group
