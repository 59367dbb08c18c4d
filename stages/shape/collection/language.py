"""What a sample is: a language that turns its assembly or its text into a `Shape`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.shape.arrays import IntArray
from stages.shape.sample import Sample
from stages.shape.shape import Shape

RebuildShape = Callable[[Mapping[str, Any], IntArray], Shape]
"""Function of a record and its contacts, int32 (m, 2), that rebuilds the shape."""


@dataclass(frozen=True)
class Source:
    """Where samples come from: a kit, a program, a category of programs. `Sample.kit` names it.

    labels: part labels of its shapes, in a fixed order
    colors: sRGB of each label; if empty, a class has the colour of its first part
    sentence: short description for the card
    contact_tolerance: of a kit, the largest distance of parts in contact, in the units of the shapes
    shares_classes: whether a label is one class with the equal labels of all other sources that share classes
    """

    labels: tuple[str, ...]
    colors: tuple[tuple[int, int, int], ...] = ()
    sentence: str = ""
    contact_tolerance: float = 0.0
    shares_classes: bool = False


class ShapeDecoder(Protocol):
    """A language with what it reads of a task. It knows the sources of the dataset."""

    @property
    def sources(self) -> Mapping[str, Source]:
        """All sources of the dataset by name, in the order of the config."""

    def shape(self, sample: Sample) -> Shape:
        """Return the shape of a sample. Raises ValueError or an error of its own for a text it cannot parse."""

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return about `count` input shapes with captions for the first row of a contact sheet."""


@dataclass(frozen=True)
class Language:
    """One language, declared as `LANGUAGE = Language(...)` in `stages/<stage>/language.py`.

    name: what records call it
    reads: function that returns the records, as `stage/shard`, without which it cannot make shapes
    decoder: function that makes the decoder of a task whose shard has those records among its inputs
    graphs: whether its samples are shape graphs, with contacts of their own and strings; otherwise a sample has a text,
        and contacts are computed from the shape
    text: what the member `txt` of its samples is, unless they are shape graphs
    rebuild: function that takes the paths of a dataset and returns a function that rebuilds the upright shape of a
        record; raises LookupError if the source is missing and ValueError for an invalid record
    coordinates: unit and origin of the coordinates, for the card
    """

    name: str
    reads: Callable[[Plan], tuple[str, ...]]
    decoder: Callable[[Task], ShapeDecoder]
    graphs: bool
    text: str
    rebuild: Callable[[DatasetPaths], RebuildShape]
    coordinates: str = ""
