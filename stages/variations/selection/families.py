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

MAX_BYTES_REMEMBERED = 2**28
"""Memory for pairs that were compared; beyond it the oldest are forgotten."""

Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
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
        width = max(-(-count // 8), 1)  # bytes; an empty pool has none
        max_rows = min(max(MAX_BYTES_REMEMBERED // (2 * width), 1), count)
        self._rows: dict[int, int] = {}  # row of each variant that is remembered, the oldest first
        self._variants = np.zeros(max_rows, dtype=np.int64)  # variant of each row
        self._bits = np.zeros((max_rows, 2, width), dtype=np.uint8)
        """Two bits for each variant of the pool: whether it was compared with the row's variant, and is near it."""
        self._near_sample: dict[int, Indices] = {}

    def around(self, variant: int, others: Indices) -> Indices:
        """Return which of `others` are near a variant; pairs that are remembered are not compared again."""
        row, (byte, bit) = self._row(variant), divmod(variant, 8)
        is_known, is_near = np.unpackbits(self._bits[row], axis=-1, count=self.count, bitorder="little").view(np.bool_)
        rows = len(self._rows)
        answers = (self._bits[:rows, :, byte] >> bit & 1).astype(np.bool_)
        is_known[self._variants[:rows]] |= answers[:, 0]
        is_near[self._variants[:rows]] |= answers[:, 1]
        unknown = others[~is_known[others]]
        if len(unknown):
            is_known[unknown] = True
            is_near[self.near(variant, unknown)] = True
            self._bits[row] = np.packbits([is_known, is_near], axis=-1, bitorder="little")
        near_ones: Indices = others[is_near[others]]
        return near_ones

    def near_sample(self, variant: int) -> Indices:
        """Return what is near a variant in the sample."""
        if variant not in self._near_sample:
            self._near_sample[variant] = self.near(variant, self.sample)
        return self._near_sample[variant]

    def cost(self, variant: int, spent: Flags) -> float:
        """Return about how many variants that are not `spent` yet are near a variant."""
        return float((~spent[self.near_sample(variant)]).sum() * self.count / len(self.sample))

    def _row(self, variant: int) -> int:
        """Return the row of a variant; a new one knows the sample, and takes the place of the oldest if need be."""
        if variant not in self._rows:
            is_full = len(self._rows) == len(self._bits)
            row = self._rows.pop(next(iter(self._rows))) if is_full else len(self._rows)
            answers = np.zeros((2, self.count), dtype=np.bool_)
            answers[0, self.sample] = answers[1, self.near_sample(variant)] = True
            self._bits[row] = np.packbits(answers, axis=-1, bitorder="little")
            self._rows[variant], self._variants[row] = row, variant
        return self._rows[variant]


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

    Several regions are given up where they leave far less for train than is wanted. A member is compared only with
    what is free, and with the sample: `touched` says for these which splits have a member near them, for others at
    least one such split.
    """
    split_of = np.zeros(ground.count, dtype=np.int8)
    touched = np.zeros((len(SPLITS), ground.count), dtype=np.bool_)
    free = np.arange(ground.count)
    left, grown = dict(sizes), 0
    while any(left.values()) and (regions == 1 or len(free) >= NEARLY_ENOUGH_SHARE * wanted["train"]):
        split = max(left, key=lambda name: left[name])
        if not len(free):
            left[split] = 0
            continue
        number = SPLITS.index(split)
        size = min(left[split], -(-sizes[split] // regions))
        affordable = max(len(free) - wanted["train"], 0) * size / sum(left.values())
        member = _cheapest(ground, rng.permutation(free)[:MIDDLES_DRAWN], touched[number], affordable)
        family = _family(ground, member, number, split_of, touched)
        for _ in range(size):
            split_of[member] = number
            touched[number, ground.near_sample(member)] = True
            touched[number, ground.around(member, _free(split_of, touched))] = True
            left[split] -= 1
            family = family[split_of[family] == 0]
            if not len(family):
                break
            member = _cheapest(ground, rng.permutation(family)[:MEMBERS_DRAWN], touched[number], 0.0)
        grown += 1
        free = _free(split_of, touched)
    split_of[(split_of == 0) & touched.any(axis=0)] = DISCARDED_SPLIT
    return Cut(split_of, grown)


def _free(split_of: npt.NDArray[np.int8], touched: Flags) -> Indices:
    """Return the variants that are in no region and near no member of one."""
    return np.flatnonzero((split_of == 0) & ~touched.any(axis=0))


def _family(ground: _Ground, middle: int, number: int, split_of: npt.NDArray[np.int8], touched: Flags) -> Indices:
    """Return the variants near the middle of a region of split `number` that are near no member of another split.

    What this split touched first was not compared with later members of the others: it is now, and `touched` completed.
    """
    others = np.arange(len(SPLITS)) != number
    family = ground.around(middle, np.flatnonzero((split_of == 0) & ~touched[others].any(axis=0)))
    doubtful = family[touched[number, family]]
    for member in np.flatnonzero((split_of > 0) & (split_of != number)).tolist():
        if not len(doubtful):
            break
        touched[split_of[member], ground.around(member, doubtful)] = True
        doubtful = doubtful[~touched[split_of[member], doubtful]]
    admitted: Indices = family[~touched[others][:, family].any(axis=0)]
    return admitted


def _cheapest(ground: _Ground, rivals: Indices, spent: Flags, affordable: float) -> int:
    """Return the first variant with at most `affordable` around it, or the one with least."""
    costs: list[float] = []
    for rival in rivals.tolist():
        costs.append(ground.cost(rival, spent))
        if costs[-1] <= affordable:
            return int(rival)
    return int(rivals[int(np.argmin(costs))])
