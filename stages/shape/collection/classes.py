"""The classes of a dataset: one id for each part label of each source, the same in every member and split."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stages.shape.collection.language import Source


@dataclass(frozen=True)
class PartClass:
    """One class.

    id: number that labels hold
    name: part label
    kit: source that the class belongs to
    color: sRGB, or None where the source defines none
    """

    id: int
    name: str
    kit: str
    color: tuple[int, int, int] | None


@dataclass(frozen=True)
class Classes:
    """The classes of a dataset.

    all: classes in the order of their ids
    first: id of the first class of each source; the ids of one source are consecutive, in the order of its labels
    """

    all: tuple[PartClass, ...]
    first: Mapping[str, int]

    @classmethod
    def of(cls, sources: Mapping[str, Source]) -> Classes:
        """Return the classes of the sources of a dataset. Raises ValueError for more than an int16 can count."""
        classes: list[PartClass] = []
        first: dict[str, int] = {}
        for kit, source in sources.items():
            first[kit] = len(classes)
            colors = source.colors or (None,) * len(source.labels)
            classes += [
                PartClass(len(classes) + index, name, kit, color)
                for index, (name, color) in enumerate(zip(source.labels, colors, strict=True))
            ]
        if len(classes) > 2**15:
            raise ValueError(f"the dataset has {len(classes):,} part labels; labels are 16-bit numbers: at most 32,768")
        return cls(tuple(classes), first)
