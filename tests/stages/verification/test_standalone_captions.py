"""The verifier that comes with a dataset reads captions back by code of its own, and finds false ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stages.captions.compose import captions
from stages.captions.facts import ShapeFacts
from stages.captions.placement import ShapePlacement
from stages.captions.words import label_nouns
from stages.package.standalone_verifier import CaptionFacts, caption_faults
from stages.programs.files import random_shapes
from stages.programs.program import build_shape, find_program
from stages.shape.geometry.contact import world_boxes
from stages.shape.shape import Shape
from tests.stages.captions.furniture import CONTACTS, PHYSICS, dresser, facts
from tests.stages.captions.test_captions import FALSE

COLORS = {"A dresser. The six drawers are black.", "A dresser. All of it is white."}
"""Colors are not checked without the project."""


def facts_of(shape: Shape, kit: str, contacts: np.ndarray, nouns: dict[str, str] | None = None) -> CaptionFacts:
    """What the verifier knows of a shape."""
    parts = [{"name": f"{place}", "label": shape.labels[label]} for place, label in enumerate(shape.part_labels)]
    record: dict[str, Any] = {"kit": kit, "parts": parts, "physics": PHYSICS, "unit": shape.unit}
    boxes = world_boxes(shape.meshes, shape.assembly.types, shape.assembly.poses)
    return CaptionFacts(record, boxes, contacts.T, nouns or {})


def faults(text: str) -> list[str]:
    return list(caption_faults({"long": text}, facts_of(dresser(), "dresser", CONTACTS)))


def test_all_captions_of_the_dresser_hold() -> None:
    known = facts_of(dresser(), "dresser", CONTACTS)
    for seed in range(20):
        texts = captions(facts(dresser()), "dresser", ("short", "medium", "long"), np.random.default_rng(seed))
        assert list(caption_faults(texts, known)) == []


@pytest.mark.parametrize("text", sorted({*FALSE} - COLORS))
def test_false_captions_are_found_without_the_project(text: str) -> None:
    assert len(faults(text)) == 1


def test_sentences_that_nobody_writes_are_found() -> None:
    assert "cannot be read" in faults("A dresser. It can fly.")[0]
    assert "does not hold" in faults("A dresser with an elephant.")[0]


def test_a_shape_is_called_as_the_config_says() -> None:
    known = facts_of(dresser(), "dresser", CONTACTS, {"dresser": "chest"})
    assert not list(caption_faults({"long": "A chest with six drawers."}, known))
    assert list(caption_faults({"long": "A dresser with six drawers."}, known))


def test_plurals_differ_from_labels_that_are_plurals() -> None:
    labels = ("planks", "plank", "glass", "shelf", "base", "revolution", "sweep")
    parts = [{"name": f"{place}", "label": labels[place % 7]} for place in range(14)]
    known = CaptionFacts({"kit": "x", "parts": parts}, np.zeros((14, 2, 3)), np.empty((2, 0)), {})
    for number, noun in (
        *(("two", "planks"), ("two", "panes of glass"), ("two", "shelves"), ("two", "bases")),
        *(("two", "turned solids"), ("two", "swept bars")),
    ):
        assert len(known.parts(number, noun)) == 2, noun
    assert known.alike("set of planks") == [0, 7]
    assert known.alike("plank") == [1, 8]


@pytest.mark.parametrize("name", ["cabinet", "vase"])
def test_captions_of_random_shapes_of_programs_hold(name: str) -> None:
    program, rng, none = find_program(name), np.random.default_rng(4), np.empty((0, 2), np.int32)
    for values in random_shapes(program, 6, seed=4):
        shape = build_shape(program, values)
        placement = ShapePlacement(front_known=True)
        stated = ShapeFacts.of(shape, none, PHYSICS, label_nouns(program.labels), placement)
        texts = captions(stated, name, ("long",), rng)
        assert list(caption_faults(texts, facts_of(shape, name, none))) == []
