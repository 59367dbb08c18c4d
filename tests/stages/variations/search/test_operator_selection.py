"""Tries go where they find most, and everywhere now and then."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.variations.kernels.operators import GROWTH
from stages.variations.search.operator_selection import EXCHANGES, PLAIN, RARE
from stages.variations.search.search import Search
from stages.variations.settings import NoveltyConfig, SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of


def line_of(exemplars: int, **novelty: float) -> Search:
    kit = kit_of(CHAIN, [chain(3 + 2 * number) for number in range(exemplars)])
    return Search(ContactOracle(kit), SearchConfig(method="exchange", novelty=NoveltyConfig.model_validate(novelty)))


def planned(line: Search, count: int = 4000) -> Counter[int]:
    choices = line.operators.plan(np.random.default_rng(0), line.parents, line.archive, count)
    assert all(planned.a in line.parents.exemplars and planned.b in line.parents.exemplars for planned in choices)
    return Counter(planned.number for planned in choices)


def test_every_choice_is_tried_and_the_best_most_often() -> None:
    line = line_of(2, exploration=0.2)
    for choice in line.operators.plan(np.random.default_rng(1), line.parents, line.archive, 2000):
        line.operators.learn(choice, float(choice.number == 5), 1.0)
    tried = planned(line)
    assert set(tried) == set(range(len(EXCHANGES)))
    assert tried[5] > 2000
    assert min(tried.values()) > 0.5 * 0.2 / len(EXCHANGES) * 4000


def test_equal_gain_for_more_work_counts_less() -> None:
    line = line_of(2)
    for choice in line.operators.plan(np.random.default_rng(1), line.parents, line.archive, 4000):
        line.operators.learn(choice, float(choice.number in (2, 9)), 3.0 if choice.number == 2 else 1.0)
    tried = planned(line)
    assert tried[9] > 3 * tried[2]


def test_one_exemplar_uses_no_families_and_no_crossing() -> None:
    tried = planned(line_of(1))
    assert {EXCHANGES[number][0] for number in tried} == {PLAIN, RARE}


@pytest.mark.parametrize("growth_share", [0.0, 1.0])
def test_unguided_search_draws_plain_parents(growth_share: float) -> None:
    unguided = SearchConfig(method="exchange", growth_share=growth_share, novelty=NoveltyConfig(guided=False))
    line = Search(line_of(2).oracle, unguided)
    assert set(planned(line)) == {0 if growth_share else 1}


@pytest.mark.parametrize("guided", [True, False])
def test_growth_gets_its_earned_share_of_the_work(guided: bool) -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    config = SearchConfig(method="both", novelty=NoveltyConfig(guided=guided))
    line, shares = Search(ContactOracle(kit), config), []
    for worth in (0.0, 1.0):
        for choice in line.operators.plan(np.random.default_rng(1), line.parents, line.archive, 4000):
            grown = choice.operator == GROWTH
            line.operators.learn(choice, worth * 60.0 if grown else 0.2, 60.0 if grown else 1.5)
        tried = planned(line, 20_000)
        shares.append(
            60.0 * tried[len(EXCHANGES)] / (60.0 * tried[len(EXCHANGES)] + 1.5 * (20_000 - tried[len(EXCHANGES)]))
        )
    if guided:
        assert shares[0] == pytest.approx(0.2, abs=0.05)
        assert shares[1] == pytest.approx(0.8, abs=0.05)
    else:
        assert shares == pytest.approx([0.5, 0.5], abs=0.1)


def test_growth_in_vain_gets_the_minimum_share() -> None:
    """Exchange has brought nothing either, so that both are worth the same but for what was forgotten."""
    line, shares = Search(line_of(2).oracle, SearchConfig(method="both")), []
    choices = line.operators.plan(np.random.default_rng(1), line.parents, line.archive, 1000)
    exchanged, growth = (
        next(planned for planned in choices if (planned.operator == GROWTH) == grown) for grown in (False, True)
    )
    for gain in (0.0, 1.0):
        for _ in range(100):
            line.operators.learn(growth, gain, 60.0)
        for _ in range(4000):
            line.operators.learn(exchanged, 0.0, 1.5)
        tried = planned(line, 10_000)  # and what is planned is forgotten
        shares.append(
            60.0 * tried[len(EXCHANGES)] / (60.0 * tried[len(EXCHANGES)] + 1.5 * (10_000 - tried[len(EXCHANGES)]))
        )
    assert shares[0] == pytest.approx(0.2, abs=0.06)
    assert shares[1] == pytest.approx(0.8, abs=0.06)
