from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import combinations
from pathlib import Path

import pytest

from pipeline.randomness import decision_rng
from stages.grammars import collisions, terminal_samples
from stages.grammars.derivation_text import parse_derivation
from stages.grammars.derived_shape import placed_terminals
from stages.grammars.distinct_shapes import METHODS, DistinctShapes
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.settings import GrammarConfig
from stages.grammars.stage import shortfall_message
from stages.grammars.terminal_samples import TerminalSamples
from stages.grammars.voxel_signature import KnownShapes, difference


def config(**settings: float) -> GrammarConfig:
    return GrammarConfig.model_validate({"name": "wall", "model": Path(__file__), **settings})


def sampled(grammar: ShapeGrammar, limit: int, **settings: float) -> tuple[dict[str, list[str]], Counter[str]]:
    """Return at most `limit` texts by each method, and how often draws were rejected, by reason."""
    rejects: Counter[str] = Counter()
    rng = partial(decision_rng, 1)
    sampler = DistinctShapes(grammar, config(**settings), rng, lambda reason: rejects.update([reason]))
    return {method: [shape.text for shape in sampler.shapes(method, limit)] for method in METHODS}, rejects


def test_shapes_differ_visibly_from_the_exemplar_and_from_others(grammar: ShapeGrammar) -> None:
    texts, rejects = sampled(grammar, 4, max_cells=9)
    assert [len(of_method) for of_method in texts.values()] == [4, 4]
    known = KnownShapes(grammar, TerminalSamples(grammar))
    signatures = [
        known.signature(placed_terminals(grammar, parse_derivation(grammar, text)))
        for of_method in texts.values()
        for text in of_method
    ]
    assert min(difference(signature, known.exemplar) for signature in signatures) >= 0.05
    assert min(difference(one, other) for one, other in combinations(signatures, 2)) >= 0.05
    assert "G0[3]" not in texts["resized grid"], "the exemplar itself"
    assert rejects["like the exemplar"]


def test_sampling_ends_when_a_grammar_has_no_more_shapes(grammar: ShapeGrammar) -> None:
    """Only walls of 1 to 3 windows: at most two cells are allowed, and the exemplar has four windows."""
    texts, rejects = sampled(grammar, 50, max_cells=2, max_pieces=1)
    assert {len(text) for text in texts["resized grid"]} == {5}
    assert sum(map(len, texts.values())) == 3
    assert rejects["like an earlier shape"]
    assert "3 of 200 requested shapes" in shortfall_message(config(), 3)
    assert "exemplars.kits" in shortfall_message(config(), 3)


def test_small_caches_do_not_change_the_shapes(grammar: ShapeGrammar, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = sampled(grammar, 3)
    monkeypatch.setattr(terminal_samples, "MAX_SAMPLE_BYTES", 1)
    monkeypatch.setattr(collisions, "MAX_CACHE_BYTES", 1)
    assert sampled(grammar, 3) == expected


def test_no_shapes_where_every_draw_looks_like_the_exemplar(grammar: ShapeGrammar) -> None:
    texts, rejects = sampled(grammar, 5, min_difference=0.95)
    assert not any(texts.values())
    assert set(rejects) <= {"like the exemplar", "collides with itself"}
