"""`classes.json`: the classes of a dataset, with the numbers of shapes and parts in each split."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from stages.shape.collection.classes import Classes
from stages.shape.shape import Shape

UNSEEN_COLOR = (160, 160, 160)
"""Colour of a class without a colour of its own and without parts, sRGB."""


class ClassTally:
    """Counts shapes and parts of each class in one shard, and keeps the colour of the first part."""

    def __init__(self) -> None:
        self._shapes: Counter[int] = Counter()
        self._parts: Counter[int] = Counter()
        self._colors: dict[int, list[int]] = {}

    def add(self, shape: Shape) -> None:
        """Count a shape."""
        classes = shape.part_classes.tolist()
        for part, number in enumerate(classes):
            if number not in self._colors:
                colors = shape.meshes[shape.assembly.types[part]].face_colors
                self._colors[number] = np.median(colors, axis=0).astype(np.uint8).tolist()
        self._parts.update(classes)
        self._shapes.update(set(classes))

    def counts(self) -> dict[str, dict[str, Any]]:
        """Return shapes, parts and colour of each class with parts, by its id."""
        return {
            str(number): {"shapes": self._shapes[number], "parts": self._parts[number], "color": color}
            for number, color in sorted(self._colors.items())
        }


def count_classes(
    classes: Classes, tallies: Iterable[tuple[str, Mapping[str, Mapping[str, Any]]]], owned: bool = False
) -> list[dict[str, Any]]:
    """Return the rows of `classes.json` in the order of ids, with classes that have no parts.

    tallies: split and `ClassTally.counts` of each shard, the shards of a split next to each other
    owned: whether a row holds `own`, the number of its label in each kit that has it

    A class whose source has no colour gets that of its first part.
    """
    counts_by_shard = list(tallies)
    splits = tuple(dict.fromkeys(split for split, _ in counts_by_shard))
    shapes: Counter[tuple[str, str]] = Counter()
    parts: Counter[tuple[str, str]] = Counter()
    seen: dict[str, tuple[int, ...]] = {}
    for split, counts in counts_by_shard:
        for number, count in counts.items():
            shapes[number, split] += count["shapes"]
            parts[number, split] += count["parts"]
            seen.setdefault(number, tuple(count["color"]))
    table = []
    for label in classes.all:
        number = str(label.id)
        red, green, blue = label.color or seen.get(number, UNSEEN_COLOR)
        table.append(
            {
                "id": label.id,
                "name": label.name,
                "kit": label.kit,
                **({"own": dict(label.own)} if owned else {}),
                "color": f"#{red:02x}{green:02x}{blue:02x}",
                "shapes": {split: shapes[number, split] for split in splits},
                "parts": {split: parts[number, split] for split in splits},
            }
        )
    return table


def table_bytes(table: Iterable[Mapping[str, Any]]) -> bytes:
    """Encode the table as JSON, a list with a line for each class."""
    lines = ",\n ".join(json.dumps(row, ensure_ascii=False, allow_nan=False) for row in table)
    return f"[{lines}]\n".encode()
