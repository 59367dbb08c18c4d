"""Captions of a known dresser, of programs, and of false statements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stages.captions.compose import captions
from stages.captions.facts import Fact, ShapeFacts, facts_of
from stages.captions.grammar import SENTENCES, CaptionParser, opening, sentence
from stages.captions.placement import ShapePlacement, placement_of
from stages.captions.truth import CHECKS, Witnessed, holds, witnessed
from stages.captions.words import label_nouns
from stages.programs.files import random_shapes
from stages.programs.program import build_shape, find_program
from stages.shape.shape import Shape
from tests.stages.captions.furniture import CONTACTS, LABELS, PHYSICS, dresser, facts

NOUNS = ("body", "front leg", "drawer")
PARSER = CaptionParser("dresser", NOUNS)


def seen(shape: Shape, **physics: Any) -> Witnessed:
    return witnessed(
        shape,
        CONTACTS,
        {**PHYSICS, **physics},
        label_nouns(LABELS),
        "dresser",
        placement=ShapePlacement(front_known=True),
    )


def test_the_facts_of_a_dresser_are_those_that_one_sees() -> None:
    found = {(fact.kind, *fact.about) for fact in facts_of(facts(dresser()))}
    assert found == {
        ("count", "6", "drawer"),
        ("count", "1", "body"),
        ("count", "4", "front leg"),
        ("parts", "11"),
        ("equal", "wide"),
        ("grid", "6", "drawer", "2", "3"),
        ("stands on", "4", "front leg"),
        ("above", "1", "body", "4", "front leg"),
        ("touches", "front leg", "1", "body"),
        ("touches", "drawer", "1", "body"),
        ("color", "1", "body", "brown"),
        ("color", "4", "front leg", "black"),
        ("color", "6", "drawer", "white"),
        ("stable",),
        ("tilt", "12"),
        ("mirror",),
    }


def test_a_drawer_out_of_line_makes_no_columns() -> None:
    assert "grid" not in {fact.kind for fact in facts_of(facts(dresser(shift=0.04)))}


def test_a_shape_that_falls_stands_on_nothing() -> None:
    kinds = {fact.kind for fact in facts_of(facts(dresser(), stable=False, rooted=False, floating=1, symmetry=0.4))}
    assert {"unstable", "not rooted"} <= kinds
    assert not {"stands on", "stable", "tilt", "mirror"} & kinds


def test_captions_get_longer_and_say_what_one_sees_first() -> None:
    texts = captions(facts(dresser()), "dresser", ("short", "medium", "long"), np.random.default_rng(1))
    assert "six drawers in two columns of three" in texts["short"]
    assert len(texts["short"]) < len(texts["medium"]) < len(texts["long"])
    assert texts["long"].count(".") > 6
    assert "stands by itself" not in texts["long"], "it says how far it can be tilted"


def test_seeds_vary_captions_and_equal_seeds_repeat_them() -> None:
    def written(seed: int) -> str:
        return captions(facts(dresser()), "dresser", ("medium",), np.random.default_rng(seed))["medium"]

    assert len({written(seed) for seed in range(12)}) > 4
    assert written(3) == written(3)


@pytest.mark.parametrize("way", SENTENCES, ids=lambda way: way.text)
def test_every_sentence_is_read_back_as_the_fact_that_it_states(way: Any) -> None:
    samples = {"n": "4", "p": "drawer", "s": "body", "w": "tall", "d": "12", "t": "2.5"}
    slots = {int(index): samples[code] for index, code in [tuple(slot.split(":")) for slot in _slots(way.text)]}
    about = {**slots, **way.fixed}
    fact = Fact(way.kind, tuple(about[index] for index in sorted(about)))
    assert way.states(fact)
    texts = {sentence(fact, np.random.default_rng(seed)) for seed in range(20)}
    for text in texts:
        assert PARSER.facts(f"A dresser. {text}") == [Fact("noun", ("dresser",)), fact]


def _slots(text: str) -> list[str]:
    return [piece.partition("}")[0] for piece in text.split("{")[1:]]


def test_the_first_sentence_is_read_back() -> None:
    things = [Fact("grid", ("6", "drawer", "2", "3")), Fact("count", ("1", "body")), Fact("count", ("4", "front leg"))]
    for seed in range(6):
        text = opening("dresser", "tall", things, np.random.default_rng(seed))
        assert PARSER.facts(text) == [Fact("noun", ("dresser",)), Fact("adjective", ("tall",)), *things]


@pytest.mark.parametrize(
    "text",
    [
        "A table with a body.",
        "A dresser with two elephants.",
        "A dresser with a body. It can fly.",
        "A dresser with a body. It stands by itself",
    ],
)
def test_what_the_grammar_does_not_say_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"sentence|list of parts|what the shape is"):
        PARSER.facts(text)


def test_every_fact_of_the_dresser_holds_and_every_kind_can_be_checked() -> None:
    assert all(holds(fact, seen(dresser())) for fact in facts_of(facts(dresser())))
    assert {way.kind for way in SENTENCES} | {"noun", "count", "adjective"} == set(CHECKS)


FALSE = (
    *("A table.", "A tall dresser.", "A dresser with five drawers.", "A dresser with two bodies."),
    "A dresser with six drawers in three columns of two.",
    "A dresser. It is made of twelve parts.",
    "A dresser. It is taller than it is wide.",
    "A dresser. It is about twice as tall as it is wide.",
    "A dresser. Its height is 1.00 m.",
    "A dresser. The six drawers are one above the other.",
    "A dresser. The four front legs form a straight row.",
    "A dresser. The six drawers form a circle.",
    "A dresser. It stands on its body.",
    "A dresser. The four front legs are above the body.",
    "A dresser. Every drawer touches at least one of the four front legs.",
    "A dresser. The six drawers are black.",
    "A dresser. All of it is white.",
    "A dresser. It does not stand by itself.",
    "A dresser. Not all of its parts are connected to the ground.",
    "A dresser. It does not tip over when it is tilted by 13 degrees.",
)


@pytest.mark.parametrize("text", FALSE)
def test_false_captions_are_found(text: str) -> None:
    parser = CaptionParser("table" if "table" in text else "dresser", NOUNS)
    assert not all(holds(fact, seen(dresser())) for fact in parser.facts(text))


@pytest.mark.parametrize("name", ["cabinet", "chair", "vase"])
def test_no_sentence_about_random_shapes_of_programs_is_false(name: str) -> None:
    program = find_program(name)
    nouns = label_nouns(program.labels)
    parser, rng = CaptionParser(name, list(nouns.values())), np.random.default_rng(4)
    for values in random_shapes(program, 12, seed=4):
        shape = build_shape(program, values)
        contacts = np.empty((0, 2), np.int32)
        texts = captions(
            ShapeFacts.of(shape, contacts, PHYSICS, nouns, ShapePlacement(front_known=True)), name, ("long",), rng
        )
        truth = witnessed(shape, contacts, PHYSICS, nouns, name, placement=ShapePlacement(front_known=True))
        assert [fact for fact in parser.facts(texts["long"]) if not holds(fact, truth)] == []


def test_a_lamp_that_hangs_is_not_said_to_stand() -> None:
    assert placement_of("programs", "ceiling_lamp") == ShapePlacement(front_known=True, hangs=True)
    assert placement_of("programs", "chair") == ShapePlacement(front_known=True)
    assert placement_of("variations", "castle") == ShapePlacement()
    hanging = ShapeFacts.of(dresser(), CONTACTS, PHYSICS, label_nouns(LABELS), ShapePlacement(hangs=True))
    assert not {"stands on", "stable", "unstable", "tilt"} & {fact.kind for fact in facts_of(hanging)}
    truth = witnessed(dresser(), CONTACTS, PHYSICS, label_nouns(LABELS), "dresser", ShapePlacement(hangs=True))
    assert not holds(Fact("stable"), truth)
    assert not holds(Fact("stands on", ("4", "front leg")), truth)
