"""Families: val and test as regions of the pool, with a gap around each that is let go of.

In a pool of variants everything is somebody's cousin: chains of near relatives join nearly all, so families cannot be
found, they must be cut. A region is a variant drawn at random and others of those near it; whatever is near a member of
a region may stand in no other split. What is near nothing in val or test is left for train.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from stages.shape.collection.assignment import SPLITS

DISCARDED = -1
REGIONS = (16, 8, 4, 2, 1)
"""Regions of a split, tried in turn until enough is left for train: many small regions show more of the pool, few large
ones have less around them."""
TRIES, NEARLY = 6, 0.9
"""So many cuts are tried for each number of regions, of several only as long as train gets nearly its share."""
RIVALS, MIDDLES = 4, 16
"""Variants drawn at random for each place, and for the middle of a region, that with least around it is taken; a middle
with little enough at once."""
ENOUGH = 0.5
"""Share of what is wanted that train gets before val and test are thought of: of a pool of near-twins there is only
train, rather than a handful of each."""
SOUNDED = 128
"""Variants of the pool on which is estimated how much is around a rival."""
REHEARSED = 256
"""Variants of a larger pool that are cut first, in proportion, to learn what number of regions it allows."""

Indices = npt.NDArray[np.int64]
Near = Callable[[int, Indices], Indices]
"""Which of some others are so near to a variant that they may stand in no other split; symmetric."""


@dataclass(frozen=True)
class Cut:
    """split_of: int8 (n,), for each variant of the pool where it may stand, counted as in SPLITS, or LET_GO; in train
    there may be more than asked for. regions: how many val and test are made of."""

    split_of: npt.NDArray[np.int8]
    regions: int

    def sizes(self, wanted: Mapping[str, int]) -> dict[str, int]:
        """How many of those wanted of each split there are."""
        return {split: min(wanted[split], int((self.split_of == SPLITS.index(split)).sum())) for split in SPLITS}


def cut_families(near: Near, count: int, wanted: Mapping[str, int], rng: np.random.Generator) -> Cut:
    """The splits of a pool of `count` variants, no two of different splits near each other.

    Val and test have as many as wanted and train at least as many, if any number of regions leaves so many; else val
    and test are halved until train has its share; and where the pool does not allow that either, the cut that gives
    most of its share to the split that gets least, if train has ENOUGH. How many regions a large pool allows is tried
    on a few of it first.
    """
    most = max(REGIONS)
    if count > 2 * REHEARSED:
        some = np.sort(rng.permutation(count)[:REHEARSED])
        fewer = {split: max(round(number * REHEARSED / count), min(number, 1)) for split, number in wanted.items()}
        most = _cut(lambda place, among: _places(near, some, place, among), REHEARSED, fewer, max(REGIONS), rng)[1]
    return _cut(near, count, wanted, most, rng)[0]


def _places(near: Near, some: Indices, place: int, among: Indices) -> Indices:
    """`near` of some of the variants, by their places among these."""
    found: Indices = among[np.isin(some[among], near(int(some[place]), some[among]))]
    return found


def _cut(near: Near, count: int, wanted: Mapping[str, int], most: int, rng: np.random.Generator) -> tuple[Cut, int]:
    """The best of several cuts, and the number of regions asked of it; no more than `most` are."""
    ground = _Ground(near, count, np.sort(rng.permutation(count)[:SOUNDED]))
    best, best_worth, asked = Cut(np.zeros(count, dtype=np.int8), 0), (-1.0, -1.0, -1), 1
    for sizes, regions in _attempts(wanted, most):
        for _ in range(TRIES):
            cut = _grow(ground, sizes, wanted, regions, rng)
            got = cut.sizes(wanted)
            shares = [got[split] / wanted[split] for split in SPLITS if wanted[split]]
            enough = min(got["train"] / max(wanted["train"], 1), ENOUGH)
            worth = enough, min(shares, default=1.0), sum(got.values())
            if worth > best_worth:
                best, best_worth, asked = cut, worth, regions
            if got["train"] == wanted["train"]:
                return best, asked
            if regions > 1 and got["train"] < NEARLY * wanted["train"]:
                break
    return best, asked


@dataclass(frozen=True)
class _Ground:
    """What is near what, remembered, in a pool of `count` variants, of which those `sounded` stand for all."""

    near: Near
    count: int
    sounded: Indices
    _around: dict[int, npt.NDArray[np.uint8]] = field(default_factory=dict)
    _heard: dict[int, Indices] = field(default_factory=dict)

    def around(self, variant: int) -> Indices:
        """All that is near a variant. What another's answer tells already is not asked again."""
        if variant not in self._around:
            is_near = np.zeros(self.count, dtype=np.bool_)
            known = np.array(list(self._around), dtype=np.int64)
            byte, bit = divmod(variant, 8)
            is_near[known] = [bool(row[byte] >> bit & 1) for row in self._around.values()]
            open_ = np.setdiff1d(np.arange(self.count), known)
            is_near[self.near(variant, open_)] = True
            self._around[variant] = np.packbits(is_near, bitorder="little")
        return np.flatnonzero(np.unpackbits(self._around[variant], count=self.count, bitorder="little"))

    def cost(self, variant: int, spent: npt.NDArray[np.bool_]) -> float:
        """About how many that are not `spent` yet are near a variant."""
        if variant not in self._heard:
            self._heard[variant] = self.near(variant, self.sounded)
        return float((~spent[self._heard[variant]]).sum() * self.count / len(self.sounded))


def _attempts(wanted: Mapping[str, int], most: int) -> list[tuple[dict[str, int], int]]:
    """Sizes of val and test with numbers of regions, `most` at most, what is asked for first, nothing at all last."""
    sizes = {split: wanted[split] for split in ("test", "val")}
    attempts = [(dict(sizes), regions) for regions in REGIONS if regions <= most]
    while any(sizes.values()):
        sizes = {split: size // 2 for split, size in sizes.items()}
        attempts.append((dict(sizes), 1))
    return attempts


def _grow(
    ground: _Ground, sizes: Mapping[str, int], wanted: Mapping[str, int], regions: int, rng: np.random.Generator
) -> Cut:
    """Val and test grown to `sizes` at most, each of about so many regions; given up where several regions leave far
    less for train than is wanted."""
    split_of = np.zeros(ground.count, dtype=np.int8)
    touched = {split: np.zeros(ground.count, dtype=np.bool_) for split in sizes}
    left, grown, rest = dict(sizes), 0, ground.count
    while any(left.values()) and (regions == 1 or rest >= NEARLY * wanted["train"]):
        split = max(left, key=lambda each: left[each])
        barred = (split_of > 0) | np.any([touched[each] for each in sizes if each != split], axis=0)
        free = np.flatnonzero(~barred & ~touched[split])
        if not len(free):
            left[split] = 0
            continue
        size = min(left[split], -(-sizes[split] // regions))
        affordable = max(rest - wanted["train"], 0) * size / sum(left.values())
        member = _cheapest(ground, rng.permutation(free)[:MIDDLES], touched[split], affordable)
        family = ground.around(member)
        for _ in range(size):
            split_of[member] = SPLITS.index(split)
            touched[split][ground.around(member)] = True
            left[split] -= 1
            family = family[~barred[family] & (split_of[family] == 0)]
            if not len(family):
                break
            member = _cheapest(ground, rng.permutation(family)[:RIVALS], touched[split], 0.0)
        grown += 1
        rest = int((~np.any([split_of > 0, *touched.values()], axis=0)).sum())
    split_of[(split_of == 0) & np.any(list(touched.values()), axis=0)] = DISCARDED
    return Cut(split_of, grown)


def _cheapest(ground: _Ground, rivals: Indices, spent: npt.NDArray[np.bool_], affordable: float) -> int:
    """Of some variants the first with no more around it than is affordable, or that with least."""
    costs: list[float] = []
    for rival in rivals.tolist():
        costs.append(ground.cost(rival, spent))
        if costs[-1] <= affordable:
            return int(rival)
    return int(rivals[int(np.argmin(costs))])
