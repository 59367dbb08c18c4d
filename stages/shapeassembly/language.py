"""The sample format of ShapeAssembly programs: a sample is a program, and its shape is its cuboids."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.shape.collection.classes import read_labels
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright
from stages.shapeassembly.shape import category_label_colors, shape_of_program_text


class ProgramDecoder:
    """Decodes programs, with the labels of each category from the assignment."""

    def __init__(self, listed: Mapping[str, Sequence[str]]) -> None:
        self.sources = {kit: _source(tuple(labels)) for kit, labels in listed.items()}

    def shape(self, sample: Sample) -> Shape:
        """Return the executed program with the labels of its category. Raises ProgramError for an invalid text."""
        return shape_of_program_text(sample.text, self.sources[sample.kit].labels)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return nothing: a program starts from a text, not from shapes."""
        return ()


def _source(labels: tuple[str, ...]) -> Source:
    colors = tuple((red, green, blue) for red, green, blue in category_label_colors(len(labels)).tolist())
    return Source(labels, colors, f"{len(labels)} part labels")


def assignment_name(dataset: str) -> str:
    """Return the shard that assigns programs to splits, and lists the labels of their parts."""
    return f"{dataset}-assignment"


def _reads(plan: Plan) -> tuple[str, ...]:
    return (f"shapeassembly/{assignment_name(plan.config.name)}",)


def _decoder(task: Task) -> ProgramDecoder:
    listed = task.input("shapeassembly", f"{assignment_name(task.config.name)}.labels.json")
    return ProgramDecoder(json.loads(listed.read_bytes()))


def _rebuild(places: DatasetPaths) -> RebuildShape:
    """Return the function that executes a record's program, with the labels that the dataset lists."""
    labels = read_labels(places.out / places.dataset / "classes.json")
    return lambda record, _: upright(shape_of_program_text(record["text"], tuple(labels.get(record["kit"], ()))))


LANGUAGE = Language(
    name="shapeassembly",
    reads=_reads,
    decoder=_decoder,
    graphs=False,
    text="Its ShapeAssembly program.",
    rebuild=_rebuild,
    coordinates="The unit is that of the program. The middle of its bounding box is the origin, and the middle of each "
    "cuboid is the origin of its mesh.",
)
