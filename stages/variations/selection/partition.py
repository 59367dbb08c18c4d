"""Which variants of a pool become samples, and in which split: by families with gaps between, or by equal graphs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.stage import Task
from stages.shape.collection.assignment import SPLITS
from stages.shape.kit import Kit
from stages.variations.requirements.hub_restoration import hub_restorer
from stages.variations.search.pool import PoolIndex
from stages.variations.selection.ancestry import Ancestry
from stages.variations.selection.families import DISCARDED, Near, cut_families
from stages.variations.selection.farthest_first import select_diverse
from stages.variations.selection.shared_surface import PackedShapes
from stages.variations.settings import VariationsConfig

COMPARED = 64
"""So many shapes of val and of test at most are compared with train."""

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SelectedSamples:
    """The samples of a kit: variants int64 (k,), places in the pool, the most telling first; split_of int64 (k,),
    counted as in SPLITS; let_go: variants of the pool that stand too near to others for any split; nearness: how near
    val and test are to train, as `nearness_of` tells."""

    variants: Indices
    split_of: Indices
    discarded: int
    nearness: dict[str, dict[str, float]]


def packed_shapes(task: Task, kit: Kit, pool: PoolIndex, variants: Indices) -> PackedShapes:
    """Some variants of a pool with their backdrops, ready to be laid upon each other."""
    backdrop = hub_restorer(task, kit.name)
    assemblies = (backdrop.fit(found.assembly(at)[0]) for found, at in pool.variants(task, variants.tolist()))
    return PackedShapes(kit, assemblies, task.config.section(VariationsConfig).search.upright)


def candidates(kit: Kit, pool: PoolIndex, config: VariationsConfig, rng: np.random.Generator) -> Indices:
    """The variants of a pool that are cut into families: all; but of a pool that spares have made larger than was asked
    for, those that differ most, since all are laid upon each other, which takes time by the square of their number.
    """
    most = min(math.ceil(config.selection.oversample * config.samples_per_kit), len(pool))
    if most == len(pool):
        return np.arange(most)
    chosen: Indices = np.sort(select_diverse(kit, pool.counts, pool.features, most, config.selection, rng))
    return chosen


def choose_by_family(
    kit: Kit, pool: PoolIndex, ancestry: Ancestry, held: Indices, shapes: PackedShapes, config: VariationsConfig,
    rng: np.random.Generator,
) -> SelectedSamples:  # fmt: skip
    """The samples of a kit, no two of different splits near: alike in graph, parent and child, siblings of one cut, or
    sharing `config.splits.min_shared_surface` of their surface or more.
    Train is what differs most among what may stand there.

    held: int64 (n,), the variants of the pool that are cut, as `candidates` gives them; shapes: theirs, in that order.
    """
    wanted = config.splits.sizes(min(config.samples_per_kit, len(pool)))
    cut = cut_families(_near(pool, ancestry, held, shapes, config.splits.min_shared_surface), len(held), wanted, rng)
    taken = [held[cut.split_of == SPLITS.index(split)] for split in SPLITS]
    able = taken[0]
    taken[0] = able[select_diverse(kit, pool.counts[able], pool.features[able], wanted["train"], config.selection, rng)]
    variants = np.concatenate(taken)
    split_of = np.repeat(np.arange(len(SPLITS)), [len(each) for each in taken])
    order = select_diverse(kit, pool.counts[variants], pool.features[variants], len(variants), config.selection, rng)
    variants, split_of = variants[order], split_of[order]
    nearness = nearness_of(shapes, np.searchsorted(held, variants), split_of)
    return SelectedSamples(variants, split_of, int((cut.split_of == DISCARDED).sum()), nearness)


def _near(pool: PoolIndex, ancestry: Ancestry, held: Indices, shapes: PackedShapes, least: float) -> Near:
    """What is near among the variants that are held, all by their places there."""
    kin = ancestry.kin()
    _, graph_of = np.unique(pool.digests[held, 0], axis=0, return_inverse=True)
    graph_of = graph_of.reshape(-1)

    def near(place: int, among: Indices) -> Indices:
        close = np.isin(held[among], kin[held[place]]) | (graph_of[among] == graph_of[place])
        rest = np.flatnonzero(~close)
        close[rest[shapes.shares(place, among[rest], least, least) > 0.0]] = True
        found: Indices = among[close & (among != place)]
        return found

    return near


def nearness_of(shapes: PackedShapes, places: Indices, split_of: Indices) -> dict[str, dict[str, float]]:
    """How much of their surface the shapes of val and of test share with the nearest of train: median and most, to
    three digits, over at most COMPARED of each, evenly spread; for splits that have any.

    places: int64 (k,), where the samples of a kit stand among `shapes`; split_of: int64 (k,), theirs.
    """
    train, nearness = places[split_of == 0], {}
    for split in SPLITS[1:]:
        own = places[split_of == SPLITS.index(split)]
        compared = own[:: max(1, -(-len(own) // COMPARED))]
        if len(train) and len(own):
            most = [shapes.most_shared(each, train) for each in compared.tolist()]
            median, greatest = round(float(np.median(most)), 3), round(max(most), 3)
            nearness[split] = {"compared": len(compared), "median": median, "most": greatest}
    return nearness
