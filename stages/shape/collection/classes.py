"""The classes of a dataset: one id for each part label of each source, the same in every member and split."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stages.shape.collection.language import Source


@dataclass(frozen=True)
class PartClass:
    """One class.

    id: number that labels hold
    name: part label
    own: number of the label in each source that has it, by the source's name
    color: sRGB of the first of these sources, or None where it defines none
    """

    id: int
    name: str
    own: Mapping[str, int]
    color: tuple[int, int, int] | None

    @property
    def kit(self) -> str:
        """The names of the sources that have the class."""
        return ", ".join(self.own)


@dataclass(frozen=True)
class Classes:
    """The classes of a dataset.

    all: classes in the order of their ids
    of_kit: classes of each source, in the order of its labels
    """

    all: tuple[PartClass, ...]
    of_kit: Mapping[str, tuple[int, ...]]

    @classmethod
    def of(cls, sources: Mapping[str, Source]) -> Classes:
        """Return the classes of the sources of a dataset. Raises ValueError for more than an int16 can count.

        Ids follow the order of the sources and of their labels. A label of a source that shares classes has the class
        of the first equal label of another such source.
        """
        classes: dict[tuple[str, str], PartClass] = {}
        of_kit: dict[str, tuple[int, ...]] = {}
        for kit, source in sources.items():
            colors = source.colors or (None,) * len(source.labels)
            place = "" if source.shares_classes else kit
            for index, (name, color) in enumerate(zip(source.labels, colors, strict=True)):
                known = classes.get((place, name), PartClass(len(classes), name, {}, color))
                classes[place, name] = replace(known, own={**known.own, kit: index})
            of_kit[kit] = tuple(classes[place, name].id for name in source.labels)
        if len(classes) > 2**15:
            raise ValueError(f"the dataset has {len(classes):,} part labels; labels are 16-bit numbers: at most 32,768")
        return cls(tuple(classes.values()), of_kit)


def labels_of_kits(table: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, int]]:
    """Return the class of each label of each kit, the labels in their order, from the rows of `classes.json`."""
    listed: dict[str, dict[int, tuple[str, int]]] = {}
    for row in table:
        for kit, index in row.get("own", {row["kit"]: row["id"]}).items():
            listed.setdefault(kit, {})[index] = (row["name"], row["id"])
    return {kit: dict(of_kit[index] for index in sorted(of_kit)) for kit, of_kit in listed.items()}


def read_labels(path: Path) -> dict[str, dict[str, int]]:
    """Return `labels_of_kits` of a `classes.json`; nothing where it cannot be read."""
    try:
        return labels_of_kits(json.loads(path.read_bytes()))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
