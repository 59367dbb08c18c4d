"""Families: val and test as regions of the pool, with a gap around each whose variants are discarded.

In a pool of variants chains of near relatives join nearly all, so families cannot be found: they must be cut. A region
is a random variant and others near it; what is near a member of a region can be in no other split. What is near nothing
in val or test is left for train.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.collection.assignment import SPLITS

DISCARDED_SPLIT = -1
"""Instead of a split: the variant is too near to another split."""
REGION_COUNTS = (16, 8, 4, 2, 1)
"""Numbers of regions of a split, tried in turn until enough is left for train: many small regions show more of the
pool, a few large ones have less around them.
"""
CUTS_TRIED, NEARLY_ENOUGH_SHARE = 6, 0.9
"""Cuts tried for each number of regions; of several regions only while train gets nearly its share."""
MEMBERS_DRAWN, MIDDLES_DRAWN = 4, 16
"""Variants drawn for each member and for the middle of a region; the one with least around it is taken. A middle with
little enough around it is taken at once.
"""
MIN_TRAIN_SHARE = 0.5
"""Share of what is wanted that train gets before val and test: a pool of near-duplicates has only train."""
SAMPLE_SIZE = 128
"""Variants of the pool that estimate how much is around a variant."""
TRIAL_SIZE = 256
"""Variants of a larger pool that are cut first, in proportion, to learn what number of regions it allows."""

Indices = npt.NDArray[np.int64]
Near = Callable[[int, Indices], Indices]
"""Returns which of some others are too near to a variant to be in another split; symmetric."""


@dataclass(frozen=True)
class Cut:
    """A division of a pool into splits."""

    split_of: npt.NDArray[np.int8]
    """int8 (n,), index of each variant's split in SPLITS, or DISCARDED; train may have more than asked for."""
    regions: int  # number of regions in val and test

    def sizes(self, wanted: Mapping[str, int]) -> dict[str, int]:
        """Return how many of the wanted variants of each split there are."""
        return {split: min(wanted[split], int((self.split_of == SPLITS.index(split)).sum())) for split in SPLITS}


def cut_families(near: Near, count: int, wanted: Mapping[str, int], rng: np.random.Generator) -> Cut:
    """Return the splits of a pool of `count` variants, no two of different splits near each other.

    Val, test and train get the wanted numbers if any number of regions leaves enough. Otherwise val and test are halved
    until train has its share. If even that fails, the best cut gives most to the split with the smallest share,
    provided that train has MIN_TRAIN_SHARE. A part of a large pool is cut first to learn how many regions it allows.
    """
    max_regions = max(REGION_COUNTS)
    if count > 2 * TRIAL_SIZE:
        some = np.sort(rng.permutation(count)[:TRIAL_SIZE])
        fewer = {split: max(round(number * TRIAL_SIZE / count), min(number, 1)) for split, number in wanted.items()}
        _, max_regions = _cut(
            lambda index, among: _near_of(near, some, index, among), TRIAL_SIZE, fewer, max_regions, rng
        )
    return _cut(near, count, wanted, max_regions, rng)[0]


def _near_of(near: Near, some: Indices, index: int, among: Indices) -> Indices:
    """Return what is near among some of the variants, by their indices among these."""
    near_ones: Indices = among[np.isin(some[among], near(int(some[index]), some[among]))]
    return near_ones


def _cut(
    near: Near, count: int, wanted: Mapping[str, int], max_regions: int, rng: np.random.Generator
) -> tuple[Cut, int]:
    """Return the best of several cuts, and the number of regions that was asked of it."""
    ground = _Ground(near, count, np.sort(rng.permutation(count)[:SAMPLE_SIZE]))
    best, best_worth, best_regions = Cut(np.zeros(count, dtype=np.int8), 0), (-1.0, -1.0, -1), 1
    for sizes, regions in _attempts(wanted, max_regions):
        for _ in range(CUTS_TRIED):
            cut = _grow(ground, sizes, wanted, regions, rng)
            got = cut.sizes(wanted)
            shares = [got[split] / wanted[split] for split in SPLITS if wanted[split]]
            enough = min(got["train"] / max(wanted["train"], 1), MIN_TRAIN_SHARE)
            worth = enough, min(shares, default=1.0), sum(got.values())
            if worth > best_worth:
                best, best_worth, best_regions = cut, worth, regions
            if got["train"] == wanted["train"]:
                return best, best_regions
            if regions > 1 and got["train"] < NEARLY_ENOUGH_SHARE * wanted["train"]:
                break
    return best, best_regions


class _Ground:
    """What is near what in a pool of `count` variants, remembered; the variants `sample` estimate the rest."""

    def __init__(self, near: Near, count: int, sample: Indices) -> None:
        self.near, self.count, self.sample = near, count, sample
        self._known: dict[int, int] = {}  # rows of `_around` by variant
        self._around = np.empty((16, -(-count // 8)), dtype=np.uint8)  # a bit for each variant of the pool
        self._near_sample: dict[int, Indices] = {}

    def around(self, variant: int) -> Indices:
        """Return all that is near a variant; what earlier answers tell is not computed again."""
        row = self._known.get(variant)
        if row is None:
            row = len(self._known)
            if row == len(self._around):
                self._around = np.concatenate([self._around, np.empty_like(self._around)])
            is_near = np.zeros(self.count, dtype=np.bool_)
            known = np.array(list(self._known), dtype=np.int64)
            byte, bit = divmod(variant, 8)
            is_near[known] = self._around[:row, byte] >> bit & 1
            unknown = np.ones(self.count, dtype=np.bool_)
            unknown[known] = False
            is_near[self.near(variant, np.flatnonzero(unknown))] = True
            self._around[row] = np.packbits(is_near, bitorder="little")
            self._known[variant] = row
        return np.flatnonzero(np.unpackbits(self._around[row], count=self.count, bitorder="little"))

    def cost(self, variant: int, spent: npt.NDArray[np.bool_]) -> float:
        """Return about how many variants that are not `spent` yet are near a variant."""
        if variant not in self._near_sample:
            self._near_sample[variant] = self.near(variant, self.sample)
        return float((~spent[self._near_sample[variant]]).sum() * self.count / len(self.sample))


def _attempts(wanted: Mapping[str, int], max_regions: int) -> list[tuple[dict[str, int], int]]:
    """Return sizes of val and test with numbers of regions: first what is asked for, last empty splits."""
    sizes = {split: wanted[split] for split in ("test", "val")}
    attempts = [(dict(sizes), regions) for regions in REGION_COUNTS if regions <= max_regions]
    while any(sizes.values()):
        sizes = {split: size // 2 for split, size in sizes.items()}
        attempts.append((dict(sizes), 1))
    return attempts


def _grow(
    ground: _Ground, sizes: Mapping[str, int], wanted: Mapping[str, int], regions: int, rng: np.random.Generator
) -> Cut:
    """Return val and test grown to at most `sizes`, each of about `regions` regions.

    Several regions are given up where they leave far less for train than is wanted.
    """
    split_of = np.zeros(ground.count, dtype=np.int8)
    touched = {split: np.zeros(ground.count, dtype=np.bool_) for split in sizes}
    left, grown, rest = dict(sizes), 0, ground.count
    while any(left.values()) and (regions == 1 or rest >= NEARLY_ENOUGH_SHARE * wanted["train"]):
        split = max(left, key=lambda name: left[name])
        barred = (split_of > 0) | np.any([touched[other] for other in sizes if other != split], axis=0)
        free = np.flatnonzero(~barred & ~touched[split])
        if not len(free):
            left[split] = 0
            continue
        size = min(left[split], -(-sizes[split] // regions))
        affordable = max(rest - wanted["train"], 0) * size / sum(left.values())
        member = _cheapest(ground, rng.permutation(free)[:MIDDLES_DRAWN], touched[split], affordable)
        family = ground.around(member)
        for _ in range(size):
            split_of[member] = SPLITS.index(split)
            touched[split][ground.around(member)] = True
            left[split] -= 1
            family = family[~barred[family] & (split_of[family] == 0)]
            if not len(family):
                break
            member = _cheapest(ground, rng.permutation(family)[:MEMBERS_DRAWN], touched[split], 0.0)
        grown += 1
        rest = int((~np.any([split_of > 0, *touched.values()], axis=0)).sum())
    split_of[(split_of == 0) & np.any(list(touched.values()), axis=0)] = DISCARDED_SPLIT
    return Cut(split_of, grown)


def _cheapest(ground: _Ground, rivals: Indices, spent: npt.NDArray[np.bool_], affordable: float) -> int:
    """Return the first variant with at most `affordable` around it, or the one with least."""
    costs: list[float] = []
    for rival in rivals.tolist():
        costs.append(ground.cost(rival, spent))
        if costs[-1] <= affordable:
            return int(rival)
    return int(rivals[int(np.argmin(costs))])
