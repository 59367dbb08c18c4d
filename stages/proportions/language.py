"""The language of proportions: a sample is an exemplar with factors, and its shape is the exemplar resized by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan
from stages.exemplars.language import KitDecoder, dataset_kits
from stages.proportions.text import ProportionShapes, shape_of_proportion_text
from stages.shape.arrays import IntArray
from stages.shape.collection.language import Language, RebuildShape
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample
from stages.shape.shape import Shape, kit_shape, part_count, upright


class ProportionDecoder:
    """The kits that a shard reads."""

    def __init__(self, kits: Mapping[str, Kit]) -> None:
        self._kits = kits
        self._shapes = {name: ProportionShapes(kit) for name, kit in kits.items()}
        self.sources = KitDecoder(kits).sources

    def shape(self, sample: Sample) -> Shape:
        """Return the exemplar resized by the sample's text. Raises ProportionError for a text that does not fit its
        kit.
        """
        return shape_of_proportion_text(self._shapes[sample.kit], sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return the exemplars, hubs among their parts."""
        exemplars = [
            (exemplar.name, kit_shape(kit, exemplar.whole)) for kit in self._kits.values() for exemplar in kit.exemplars
        ]
        return [(f"{name}, {part_count(shape)}", shape) for name, shape in exemplars[:count]]


def _reads(plan: Plan) -> tuple[str, ...]:
    return tuple(f"exemplars/{name}" for name in plan.shards("exemplars"))


def _rebuild(paths: DatasetPaths) -> RebuildShape:
    kits = {name: ProportionShapes(kit) for name, kit in dataset_kits(paths).items()}

    def shape(record: Mapping[str, Any], _: IntArray) -> Shape:
        if record["kit"] not in kits:
            raise LookupError(f"kit {record['kit']} is missing in the dataset's .work folder")
        return upright(shape_of_proportion_text(kits[record["kit"]], record["text"]))

    return shape


LANGUAGE = Language(
    name="proportions",
    reads=_reads,
    decoder=lambda task: ProportionDecoder(input_kits(task)),
    graphs=False,
    text="Its proportions as JSON: the exemplar, the periods of rows that were inserted or removed, if any, and for "
    "each axis the factors of the intervals between the ends of the parts.",
    rebuild=_rebuild,
    coordinates="The lowest point is as high as in the exemplar. The origin "
    "of a mesh is the middle of the box around the part, and poses do not rotate.",
)
