"""Families are cut: nothing near in two splits, sizes as asked where the pool allows, and said where it does not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.collection.assignment import SPLITS
from stages.variations.report.split_report import shortage, splits_table
from stages.variations.selection import families
from stages.variations.selection.ancestry import Ancestry
from stages.variations.selection.families import DISCARDED_SPLIT, Cut, Near, cut_families


def near_by(matrix: np.ndarray) -> Near:
    def near(variant: int, among: np.ndarray) -> np.ndarray:
        return among[matrix[variant, among] & (among != variant)]

    return near


def crossings(matrix: np.ndarray, cut: Cut) -> int:
    """How many near pairs stand in two splits."""
    i, j = np.nonzero(matrix)
    a, b = cut.split_of[i], cut.split_of[j]
    return int(((a != b) & (a != DISCARDED_SPLIT) & (b != DISCARDED_SPLIT)).sum())


def grow_from_all_pairs(
    ground: families._Ground, sizes: Mapping[str, int], wanted: Mapping[str, int], regions: int,
    rng: np.random.Generator,
) -> Cut:  # fmt: skip
    """Grow val and test by their definition, from all pairs of the pool."""
    everything = np.arange(ground.count)
    matrix = np.array([np.isin(everything, ground.near(variant, everything)) for variant in everything.tolist()])
    split_of = np.zeros(ground.count, dtype=np.int8)
    left, grown = dict(sizes), 0

    def near_any(members: np.ndarray) -> np.ndarray:
        touched: np.ndarray = matrix[members].any(axis=0)
        return touched

    while any(left.values()):
        free = np.flatnonzero((split_of == 0) & ~near_any(split_of > 0))
        if regions > 1 and len(free) < families.NEARLY_ENOUGH_SHARE * wanted["train"]:
            break
        split = max(left, key=lambda name: left[name])
        if not len(free):
            left[split] = 0
            continue
        number = SPLITS.index(split)
        size = min(left[split], -(-sizes[split] // regions))
        affordable = max(len(free) - wanted["train"], 0) * size / sum(left.values())
        rivals = rng.permutation(free)[: families.MIDDLES_DRAWN]
        member = families._cheapest(ground, rivals, near_any(split_of == number), affordable)
        family = np.flatnonzero(matrix[member] & ~near_any((split_of > 0) & (split_of != number)))
        for _ in range(size):
            split_of[member] = number
            left[split] -= 1
            family = family[split_of[family] == 0]
            if not len(family):
                break
            rivals = rng.permutation(family)[: families.MEMBERS_DRAWN]
            member = families._cheapest(ground, rivals, near_any(split_of == number), 0.0)
        grown += 1
    split_of[(split_of == 0) & near_any(split_of > 0)] = DISCARDED_SPLIT
    return Cut(split_of, grown)


@pytest.mark.parametrize("bytes_remembered", [families.MAX_BYTES_REMEMBERED, 512])
@pytest.mark.parametrize("density", [0.0, 0.002, 0.01, 0.03, 0.1, 0.4, 1.0])
@pytest.mark.parametrize("count", [0, 7, 90, 250])
def test_cut_is_that_of_all_pairs(
    count: int, density: float, bytes_remembered: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(families, "MAX_BYTES_REMEMBERED", bytes_remembered)
    for seed, by_place in ((0, False), (1, True)):
        rng = np.random.default_rng(seed)
        places = rng.random(count)
        matrix = np.abs(places[:, None] - places) < density / 2 if by_place else rng.random((count, count)) < density
        near = near_by(np.triu(matrix) | np.triu(matrix).T)
        wanted = {"train": count // 3, "val": count // 12, "test": count // 10}
        ours, reference = np.random.default_rng(seed), np.random.default_rng(seed)
        cut = cut_families(near, count, wanted, ours)
        with monkeypatch.context() as patched:
            patched.setattr(families, "_grow", grow_from_all_pairs)
            expected = cut_families(near, count, wanted, reference)
        assert cut.split_of.tolist() == expected.split_of.tolist()
        assert cut.regions == expected.regions
        assert ours.bit_generator.state == reference.bit_generator.state


def test_clusters_are_not_divided_by_splits() -> None:
    cluster = np.arange(120) // 6
    matrix = cluster[:, None] == cluster[None]
    wanted = {"train": 40, "val": 10, "test": 14}
    cut = cut_families(near_by(matrix), 120, wanted, np.random.default_rng(0))
    assert cut.sizes(wanted) == wanted
    assert crossings(matrix, cut) == 0
    for number in range(20):
        assert len(set(cut.split_of[cluster == number].tolist()) - {DISCARDED_SPLIT}) <= 1


def test_chain_of_relatives_is_cut_with_a_gap() -> None:
    places = np.arange(300)
    matrix = np.abs(places[:, None] - places[None]) <= 4
    wanted = {"train": 100, "val": 15, "test": 15}
    cut = cut_families(near_by(matrix), 300, wanted, np.random.default_rng(0))
    assert cut.sizes(wanted) == wanted
    assert cut.regions > 1
    for split in (1, 2):
        own, others = (
            np.flatnonzero(cut.split_of == split),
            np.flatnonzero(~np.isin(cut.split_of, (split, DISCARDED_SPLIT))),
        )
        assert np.abs(own[:, None] - others[None]).min() > 4
    assert (cut.split_of == DISCARDED_SPLIT).any()


def test_large_pool_is_tried_on_a_sample_and_no_pair_compared_twice() -> None:
    count, asked = 1500, 0
    places = np.random.default_rng(1).permutation(count)
    matrix = np.abs(places[:, None] - places[None]) <= 60

    def near(variant: int, among: np.ndarray) -> np.ndarray:
        nonlocal asked
        asked += len(among)
        return near_by(matrix)(variant, among)

    wanted = {"train": 600, "val": 60, "test": 60}
    cut = cut_families(near, count, wanted, np.random.default_rng(0))
    assert cut.sizes(wanted) == wanted
    assert crossings(matrix, cut) == 0
    assert asked < count**2 / 2


def test_pool_of_near_duplicates_has_only_train() -> None:
    wanted = {"train": 8, "val": 1, "test": 1}
    cut = cut_families(near_by(np.ones((10, 10), dtype=bool)), 10, wanted, np.random.default_rng(0))
    assert cut.sizes(wanted) == {"train": 8, "val": 0, "test": 0}
    splits = {split: {"wanted": wanted[split], "samples": size} for split, size in cut.sizes(wanted).items()}
    measures = {"splits": splits, "split_by": "family", "min_shared_surface": 0.8, "discarded": 0, "pool": 10}
    assert shortage(measures) == "val 0 of 1, test 0 of 1"
    assert "toys: 0 of 10 variants were too near to another split; fewer than asked for: val 0" in splits_table(
        {"toys": measures}
    )


def test_dense_pool_gives_train_its_samples_first() -> None:
    matrix = np.ones((200, 200), dtype=bool)
    matrix[0, 1:15] = matrix[1:15, 0] = matrix[1, 2:15] = matrix[2:15, 1] = False  # 13 are apart from these two
    wanted = {"train": 80, "val": 10, "test": 10}
    cut = cut_families(near_by(matrix), 200, wanted, np.random.default_rng(0))
    assert cut.sizes(wanted) == {"train": 80, "val": 0, "test": 0}
    assert crossings(matrix, cut) == 0


def test_too_dense_pool_gives_every_split_a_share() -> None:
    cluster = np.arange(40) // 20
    matrix = cluster[:, None] == cluster[None]
    wanted = {"train": 30, "val": 5, "test": 5}
    cut = cut_families(near_by(matrix), 40, wanted, np.random.default_rng(0))
    sizes = cut.sizes(wanted)
    assert crossings(matrix, cut) == 0
    assert sum(sizes.values()) >= 25
    assert sizes != wanted


@given(st.integers(1, 60), st.floats(0, 0.5), st.integers(0, 10_000))
def test_no_near_pair_is_in_two_splits(count: int, density: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.random((count, count)) < density
    matrix |= matrix.T
    val, test = count // 8, count // 6
    wanted = {"train": count // 3 or 1, "val": val, "test": test}
    cut = cut_families(near_by(matrix), count, wanted, rng)
    assert crossings(matrix, cut) == 0
    assert (cut.split_of == 1).sum() <= val
    assert (cut.split_of == 2).sum() <= test


def test_kin_are_parents_children_and_siblings_of_one_cut() -> None:
    ancestry = Ancestry([("keep",), (0, "ward"), (0, "ward"), (1, 2)], ["", "same", "same", ""])
    assert [entry.tolist() for entry in ancestry.kin()] == [[1, 2], [0, 2, 3], [0, 1, 3], [1, 2]]


def test_parents_outside_the_split_are_replaced_by_their_parents() -> None:
    ancestry = Ancestry([("keep",), (0, "ward"), (1,), (1, 0), (2, 3)], [""] * 5)
    keys = {0: "k-0", 2: "k-2", 3: "k-3", 4: "k-4"}
    splits = {0: 0, 2: 2, 3: 0, 4: 0}
    named = ancestry.named(keys, splits)
    assert named == {0: ["keep"], 2: ["keep", "ward"], 3: ["k-0", "ward"], 4: ["k-0", "ward", "k-3"]}
