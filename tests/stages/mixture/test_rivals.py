"""Which samples are left out so that no two rivals remain."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from stages.mixture.rivals import left_out

Pairs = list[tuple[int, int]]


def all_rivals(pairs: Pairs, groups: np.ndarray, makers: np.ndarray, splits: np.ndarray) -> set[tuple[int, int]]:
    """Every pair of rivals, listed."""
    equal = {
        (a, b)
        for a, b in combinations(range(len(groups)), 2)
        if groups[a] == groups[b] and makers[a] != makers[b] and splits[a] != splits[b]
    }
    return equal | set(pairs)


def left_out_one_by_one(rivals: set[tuple[int, int]], splits: np.ndarray) -> list[int]:
    """Leave out the sample with most rivals until none has one, by counting all of them each time."""
    out = []
    while rivals:
        counts = np.bincount(np.array(list(rivals)).ravel(), minlength=len(splits))
        worst = max(range(len(splits)), key=lambda sample: (counts[sample], -splits[sample], -sample))
        rivals = {pair for pair in rivals if worst not in pair}
        out.append(worst)
    return sorted(out)


def apart(*splits: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples of a group and a producer each."""
    return np.arange(len(splits)), np.arange(len(splits)), np.array(splits)


def test_what_is_in_most_pairs_is_left_out_and_else_what_is_in_train() -> None:
    samples = apart(0, 1, 0, 0, 2)
    assert left_out([(0, 1), (1, 2), (1, 3)], *samples) == [1]
    assert left_out([(0, 1), (3, 4)], *samples) == [0, 3]
    assert left_out([], *samples) == []


@pytest.mark.parametrize("seed", range(40))
def test_result_is_that_of_counting_every_pair_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, group_count, pair_count = [(12, 3, 0), (40, 4, 10), (30, 1, 60), (60, 30, 200)][seed % 4]
    groups, makers, splits = (rng.integers(number, size=count) for number in (group_count, 3, 3))
    drawn = {(min(pair), max(pair)) for pair in rng.integers(count, size=(pair_count, 2)).tolist()}
    pairs = [
        (a, b) for a, b in sorted(drawn) if groups[a] != groups[b] and makers[a] != makers[b] and splits[a] != splits[b]
    ]
    found = left_out(pairs, groups, makers, splits)
    rivals = all_rivals(pairs, groups, makers, splits)
    assert found == left_out_one_by_one(rivals, splits)
    assert not {pair for pair in rivals if not set(pair) & set(found)}


def test_group_of_many_samples_is_never_listed_in_pairs() -> None:
    rng = np.random.default_rng(0)
    makers, splits = rng.integers(2, size=200_000), rng.choice(3, size=200_000, p=[0.8, 0.1, 0.1])
    kept = np.setdiff1d(np.arange(200_000), left_out([], np.zeros(200_000, np.int64), makers, splits))
    cells = set(zip(makers[kept].tolist(), splits[kept].tolist(), strict=True))
    assert not any(a[0] != b[0] and a[1] != b[1] for a, b in combinations(cells, 2))
    assert len(kept) > 80_000
