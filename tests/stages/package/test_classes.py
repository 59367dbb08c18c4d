"""The table of classes: counts by split, colours, and a card that stays short."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from stages.package.classes import ClassTally, count_classes, table_bytes
from stages.package.tables import MAX_CLASSES_LISTED, class_table
from stages.shape.collection.classes import Classes, labels_of_kits
from stages.shape.collection.language import Source
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

CLASSES = Classes.of({"stools": Source(("leg", "seat", "rung")), "lamps": Source(("shade",), ((1, 2, 255),))})


def stool(legs: int) -> Shape:
    """`legs` brown legs, then a seat, mostly green."""
    face = np.array([[0, 1, 2]], dtype=np.int32)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    leg = PartMesh("leg", corners, face, np.array([[150, 100, 50]], np.uint8))
    seat = PartMesh("seat", corners, face.repeat(3, axis=0), np.array([[0, 200, 0]] * 2 + [[255, 0, 0]], np.uint8))
    poses = np.tile(np.eye(4), (legs + 1, 1, 1))
    assembly = Assembly(np.array([0] * legs + [1], np.int16), poses, np.empty((0, 2), np.int32))
    return Shape((leg, seat), assembly, "y", ("leg", "seat", "rung"))


def tally(*legs: int) -> dict[str, dict[str, Any]]:
    counted = ClassTally()
    for count in legs:
        counted.add(stool(count))
    return counted.counts()


def test_shapes_and_parts_are_counted_by_split() -> None:
    table = count_classes(CLASSES, [("train", tally(3, 4)), ("train", tally(3)), ("test", tally(5))])
    assert [(item["shapes"], item["parts"]) for item in table] == [
        ({"train": 3, "test": 1}, {"train": 10, "test": 5}),
        ({"train": 3, "test": 1}, {"train": 3, "test": 1}),
        ({"train": 0, "test": 0}, {"train": 0, "test": 0}),
        ({"train": 0, "test": 0}, {"train": 0, "test": 0}),
    ]


def test_a_class_has_the_colour_of_its_source_or_of_its_first_part() -> None:
    table = count_classes(CLASSES, [("train", tally(3))])
    assert [item["color"] for item in table] == ["#966432", "#00c800", "#a0a0a0", "#0102ff"]


def test_the_table_is_json_with_a_line_for_every_class() -> None:
    table = count_classes(CLASSES, [("train", tally(3))])
    content = table_bytes(table)
    assert json.loads(content) == table
    assert len(content.splitlines()) == len(table)


def test_a_card_lists_the_first_of_very_many_classes_and_counts_the_others() -> None:
    many = Classes.of({"words": Source(tuple(f"word{number}" for number in range(1500)))})
    text = class_table(count_classes(many, [("train", {})]), ["train"])
    assert f"| {MAX_CLASSES_LISTED - 1} | word{MAX_CLASSES_LISTED - 1} |" in text
    assert f"word{MAX_CLASSES_LISTED} " not in text
    assert "And 1,440 more." in text


def test_equal_labels_of_two_sources_are_two_classes_or_share_one() -> None:
    labels = {"stools": ("leg", "seat"), "tables": ("top", "leg")}
    apart = Classes.of({kit: Source(own) for kit, own in labels.items()})
    assert dict(apart.of_kit) == {"stools": (0, 1), "tables": (2, 3)}
    together = Classes.of({kit: Source(own, shares_classes=True) for kit, own in labels.items()})
    assert dict(together.of_kit) == {"stools": (0, 1), "tables": (2, 0)}
    assert [(label.name, dict(label.own)) for label in together.all] == [
        ("leg", {"stools": 0, "tables": 1}),
        ("seat", {"stools": 1}),
        ("top", {"tables": 0}),
    ]
    for classes in (apart, together):
        listed = labels_of_kits(count_classes(classes, [("train", {})], owned=True))
        assert {kit: tuple(of_kit) for kit, of_kit in listed.items()} == labels
        assert {kit: tuple(of_kit.values()) for kit, of_kit in listed.items()} == dict(classes.of_kit)


def test_labels_of_kits_are_read_without_their_own_numbers() -> None:
    table = count_classes(CLASSES, [("train", {})])
    assert "own" not in table[0]
    assert labels_of_kits(table) == {"stools": {"leg": 0, "seat": 1, "rung": 2}, "lamps": {"shade": 3}}
