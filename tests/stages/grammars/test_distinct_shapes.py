from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import combinations
from pathlib import Path

import pytest

from pipeline.randomness import decision_rng
from stages.grammars import collisions, terminal_samples
from stages.grammars.derivation_text import parse_derivation, placed_terminals
from stages.grammars.distinct_shapes import METHODS, DistinctShapes, shortfall_message
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.settings import GrammarConfig
from stages.grammars.terminal_samples import TerminalSamples
from stages.grammars.voxel_signature import KnownShapes, difference


def config(**settings: float) -> GrammarConfig:
    return GrammarConfig.model_validate({"name": "wall", "model": Path(__file__), **settings})


def drawn(grammar: ShapeGrammar, most: int, **settings: float) -> tuple[dict[str, list[str]], Counter[str]]:
    """The texts of at most so many shapes by each method, and how often draws were refused, by reason."""
    why: Counter[str] = Counter()
    variety = DistinctShapes(grammar, config(**settings), partial(decision_rng, 1), lambda reason: why.update([reason]))
    return {method: [each.text for each in variety.shapes(method, most)] for method in METHODS}, why


def test_shapes_differ_from_the_exemplar_and_from_each_other_by_what_one_sees(grammar: ShapeGrammar) -> None:
    texts, why = drawn(grammar, 4, max_cells=9)
    assert [len(each) for each in texts.values()] == [4, 4]
    known = KnownShapes(grammar, TerminalSamples(grammar))
    sights = [
        known.sight(placed_terminals(grammar, parse_derivation(grammar, each)))
        for listed in texts.values()
        for each in listed
    ]
    assert min(difference(each, known.exemplar) for each in sights) >= 0.05
    assert min(difference(one, other) for one, other in combinations(sights, 2)) >= 0.05
    assert "G0[3]" not in texts["resized grid"], "as many windows as the exemplar has"
    assert why["like the exemplar"]


def test_a_grammar_without_more_shapes_ends_and_is_told_of(grammar: ShapeGrammar) -> None:
    """Walls of 1 to 3 windows and no others, for at most two cells are allowed, and four were there."""
    texts, why = drawn(grammar, 50, max_cells=2, max_pieces=1)
    assert {len(each) for each in texts["resized grid"]} == {5}
    assert sum(map(len, texts.values())) == 3
    assert why["like one drawn before"]
    assert "3 of 200 shapes" in shortfall_message(config(), 3)
    assert "exemplars.kits" in shortfall_message(config(), 3)


def test_shapes_are_the_same_where_next_to_nothing_is_held(
    grammar: ShapeGrammar, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = drawn(grammar, 3)
    for module in (terminal_samples, collisions):
        monkeypatch.setattr(module, "HELD", 1)
    assert drawn(grammar, 3) == expected


def test_where_all_that_can_be_drawn_is_like_the_exemplar_there_is_nothing(grammar: ShapeGrammar) -> None:
    texts, why = drawn(grammar, 5, min_difference=0.95)
    assert not any(texts.values())
    assert set(why) <= {"like the exemplar", "runs into itself"}
