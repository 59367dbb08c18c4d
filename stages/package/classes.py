"""`classes.json`: what each class of a dataset is, and how many shapes and parts of each split have it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from stages.shape.collection.classes import Classes
from stages.shape.shape import Shape

UNSEEN_COLOR = (160, 160, 160)
"""The colour of a class that has none of its own and of which there is no part."""


class ClassTally:
    """How many shapes and parts of one shard have each class, and in which colour."""

    def __init__(self) -> None:
        self._shapes: Counter[int] = Counter()
        self._parts: Counter[int] = Counter()
        self._colors: dict[int, list[int]] = {}

    def add(self, shape: Shape) -> None:
        """Count one more shape."""
        classes = shape.part_classes.tolist()
        for part, number in enumerate(classes):
            if number not in self._colors:
                colors = shape.meshes[shape.assembly.types[part]].face_colors
                self._colors[number] = np.median(colors, axis=0).astype(np.uint8).tolist()
        self._parts.update(classes)
        self._shapes.update(set(classes))

    def counts(self) -> dict[str, dict[str, Any]]:
        """Of each class that is there, by its id: shapes, parts, and the colour of the first part."""
        return {
            str(number): {"shapes": self._shapes[number], "parts": self._parts[number], "color": color}
            for number, color in sorted(self._colors.items())
        }


def count_classes(
    classes: Classes, tallies: Iterable[tuple[str, Mapping[str, Mapping[str, Any]]]]
) -> list[dict[str, Any]]:
    """What `classes.json` says: the classes in the order of their ids, also those of which there is no part.

    tallies: split and `ClassTally.counts` of each shard, the shards of a split next to each other. A class whose
    source names no colour has that of its first part.
    """
    each_split = list(tallies)
    splits = tuple(dict.fromkeys(split for split, _ in each_split))
    shapes: Counter[tuple[str, str]] = Counter()
    parts: Counter[tuple[str, str]] = Counter()
    seen: dict[str, tuple[int, ...]] = {}
    for split, counts in each_split:
        for number, count in counts.items():
            shapes[number, split] += count["shapes"]
            parts[number, split] += count["parts"]
            seen.setdefault(number, tuple(count["color"]))
    table = []
    for each in classes.all:
        number = str(each.id)
        red, green, blue = each.color or seen.get(number, UNSEEN_COLOR)
        table.append(
            {
                "id": each.id,
                "name": each.name,
                "kit": each.kit,
                "color": f"#{red:02x}{green:02x}{blue:02x}",
                "shapes": {split: shapes[number, split] for split in splits},
                "parts": {split: parts[number, split] for split in splits},
            }
        )
    return table


def table_bytes(table: Iterable[Mapping[str, Any]]) -> bytes:
    """The table as JSON, a list with a line for each class."""
    lines = ",\n ".join(json.dumps(each, ensure_ascii=False, allow_nan=False) for each in table)
    return f"[{lines}]\n".encode()
