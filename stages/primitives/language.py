"""The language of compositions: a sample is a list of placed solids, and its shape consists of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.paths import DatasetPaths
from stages.primitives.settings import KINDS
from stages.primitives.text import shape_of_composition_text
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright
from stages.shape.views.palette import label_colors

KIT = "primitives"


class CompositionDecoder:
    """Makes the solids of samples."""

    def __init__(self) -> None:
        colors = tuple((red, green, blue) for red, green, blue in label_colors(len(KINDS)).tolist())
        self.sources: Mapping[str, Source] = {KIT: Source(KINDS, colors, f"{len(KINDS)} kinds of solids")}

    def shape(self, sample: Sample) -> Shape:
        """Return the shape of a sample. Raises CompositionError for a text that describes none."""
        return shape_of_composition_text(sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return nothing: solids are drawn at random."""
        return ()


def _rebuild(_: DatasetPaths) -> RebuildShape:
    return lambda record, _: upright(shape_of_composition_text(record["text"]))


LANGUAGE = Language(
    name="composition",
    reads=lambda _: (),
    decoder=lambda _: CompositionDecoder(),
    graphs=False,
    text="Its solids as JSON: kind, numbers, whether mirrored, turn as a quaternion, and place of each.",
    rebuild=_rebuild,
    coordinates="Shapes are on the plane y = 0. The origin of a mesh is the middle of its box.",
)
