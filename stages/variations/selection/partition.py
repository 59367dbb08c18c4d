"""The division of a pool into splits: by families with gaps between them, or by equal graphs."""

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
from stages.variations.selection.families import DISCARDED_SPLIT, Near, cut_families
from stages.variations.selection.farthest_first import select_diverse
from stages.variations.selection.shared_surface import PackedShapes
from stages.variations.settings import VariationsConfig

MAX_SHAPES_COMPARED = 64
"""Shapes of val and of test that are compared with train at most."""

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SelectedSamples:
    """The samples of a kit."""

    variants: Indices  # int64 (k,), numbers in the pool, the most diverse first
    split_of: Indices  # int64 (k,), indices into SPLITS
    discarded: int  # number of variants of the pool that are too near to another split
    nearness: dict[str, dict[str, float]]  # see `nearness_of`


def packed_shapes(task: Task, kit: Kit, pool: PoolIndex, variants: Indices) -> PackedShapes:
    """Return variants of a pool with their hubs restored, packed to be laid on each other."""
    restorer = hub_restorer(task, kit.name)
    assemblies = (restorer.fit(found.assembly(index)[0]) for found, index in pool.variants(task, variants.tolist()))
    return PackedShapes(kit, assemblies, task.config.section(VariationsConfig).search.upright)


def split_candidates(kit: Kit, pool: PoolIndex, config: VariationsConfig, rng: np.random.Generator) -> Indices:
    """Return the variants of a pool that are divided into splits: all, or the number asked for of the most diverse.

    The reserve can make a pool larger than asked for, and dividing takes time quadratic in the number.
    """
    count = min(math.ceil(config.selection.oversample * config.samples_per_kit), len(pool))
    if count == len(pool):
        return np.arange(count)
    chosen: Indices = np.sort(select_diverse(kit, pool.counts, pool.features, count, config, rng))
    return chosen


def choose_by_family(
    kit: Kit, pool: PoolIndex, ancestry: Ancestry, considered: Indices, shapes: PackedShapes, config: VariationsConfig,
    rng: np.random.Generator,
) -> SelectedSamples:  # fmt: skip
    """Return the samples of a kit, no two of different splits near each other.

    Near are equal graphs, parent and child, siblings of one cut, and variants that share at least
    `config.splits.min_shared_surface` of their surface. Train is the most diverse subset of what may go there.
    considered: int64 (n,), the variants that are divided, as from `split_candidates`
    shapes: the same variants, in that order
    """
    wanted = config.splits.sizes(min(config.samples_per_kit, len(pool)))
    cut = cut_families(
        _near(pool, ancestry, considered, shapes, config.splits.min_shared_surface), len(considered), wanted, rng
    )
    taken = [considered[cut.split_of == SPLITS.index(split)] for split in SPLITS]
    free = taken[0]
    taken[0] = free[select_diverse(kit, pool.counts[free], pool.features[free], wanted["train"], config, rng)]
    variants = np.concatenate(taken)
    split_of = np.repeat(np.arange(len(SPLITS)), [len(members) for members in taken])
    order = select_diverse(kit, pool.counts[variants], pool.features[variants], len(variants), config, rng)
    variants, split_of = variants[order], split_of[order]
    nearness = nearness_of(shapes, np.searchsorted(considered, variants), split_of)
    return SelectedSamples(variants, split_of, int((cut.split_of == DISCARDED_SPLIT).sum()), nearness)


def _near(pool: PoolIndex, ancestry: Ancestry, considered: Indices, shapes: PackedShapes, min_share: float) -> Near:
    """Return the test of nearness among the considered variants, by their indices there."""
    kin = ancestry.kin()
    _, graph_of = np.unique(pool.digests[considered, 0], axis=0, return_inverse=True)
    graph_of = graph_of.reshape(-1)

    def near(index: int, among: Indices) -> Indices:
        close = np.isin(considered[among], kin[considered[index]]) | (graph_of[among] == graph_of[index])
        rest = np.flatnonzero(~close)
        close[rest[shapes.shares(index, among[rest], min_share, min_share) > 0.0]] = True
        near_ones: Indices = among[close & (among != index)]
        return near_ones

    return near


def nearness_of(shapes: PackedShapes, places: Indices, split_of: Indices) -> dict[str, dict[str, float]]:
    """Return how much of their surface the shapes of val and of test share with the nearest of train.

    For each split that has samples: `median` and `most`, to three digits, over the `compared` shapes, evenly spread.
    places: int64 (k,), indices of a kit's samples in `shapes`
    split_of: int64 (k,), their splits
    """
    train, nearness = places[split_of == 0], {}
    for split in SPLITS[1:]:
        own = places[split_of == SPLITS.index(split)]
        compared = own[:: max(1, -(-len(own) // MAX_SHAPES_COMPARED))]
        if len(train) and len(own):
            shared = [shapes.most_shared(shape, train) for shape in compared.tolist()]
            median, most = round(float(np.median(shared)), 3), round(max(shared), 3)
            nearness[split] = {"compared": len(compared), "median": median, "most": most}
    return nearness
