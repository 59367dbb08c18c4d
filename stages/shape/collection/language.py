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
"""The shape of a record and its contacts, int32 (m, 2)."""


@dataclass(frozen=True)
class Source:
    """Where samples come from: a kit, a program, a category of programs. `Sample.kit` names it.

    labels: the part labels of its shapes, in a fixed order; colors: one for each label, sRGB, or none at all: then
    a class has that of its first part; sentence: what a card says of it, in a few words.
    contact_tolerance: of shape graphs the largest distance of parts in contact, in the units of the shapes.
    """

    labels: tuple[str, ...]
    colors: tuple[tuple[int, int, int], ...] = ()
    sentence: str = ""
    contact_tolerance: float = 0.0


class ShapeDecoder(Protocol):
    """A language with what it reads of a task: it knows the sources of the dataset."""

    @property
    def sources(self) -> Mapping[str, Source]:
        """All sources of the dataset by name, in the order of the config."""

    def shape(self, sample: Sample) -> Shape:
        """The shape of a sample. Raises ValueError or an error of its own for a text that it does not understand."""

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """About `count` shapes with captions that go into the making, for the first row of a contact sheet."""


@dataclass(frozen=True)
class Language:
    """One language. `LANGUAGE = Language(...)` stands in `stages/<stage>/language.py`.

    name: what records call it; reads: the records, as `stage/shard`, without which it cannot make shapes;
    speaker: the language inside a task whose shard has those among its inputs.
    graphs: whether its samples are shape graphs, with contacts of their own and strings; else they have a text, and
    contacts are found by whoever asks.
    text: what the member `txt` of its samples is, unless they are shape graphs; coordinates: their unit, and where
    their origin is; for the card.
    anew: the shape that the record of a packaged sample says, made anew and upright, given the mill's folders of its
    dataset; raises LookupError where what it is made from is not there, ValueError where the record cannot be meant.
    """

    name: str
    reads: Callable[[Plan], tuple[str, ...]]
    decoder: Callable[[Task], ShapeDecoder]
    graphs: bool
    text: str
    rebuild: Callable[[DatasetPaths], RebuildShape]
    coordinates: str = ""
