"""The language of ShapeAssembly programs: a sample is a program, and its shape is its cuboids."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright
from stages.shapeassembly.shape import label_colors, shape_of_text


class ProgramDecoder:
    """The categories of programs that the assignment has listed with the labels of their parts."""

    def __init__(self, listed: Mapping[str, Sequence[str]]) -> None:
        self.sources = {kit: _source(tuple(labels)) for kit, labels in listed.items()}

    def shape(self, sample: Sample) -> Shape:
        """The executed program, its labels those of its category. Raises ProgramError for a text that is none."""
        return shape_of_text(sample.text, self.sources[sample.kit].labels)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Nothing: a program begins with a text."""
        return ()


def _source(labels: tuple[str, ...]) -> Source:
    colors = tuple((red, green, blue) for red, green, blue in label_colors(len(labels)).tolist())
    return Source(labels, colors, f"{len(labels)} part labels")


def assignment_name(dataset: str) -> str:
    """The shard that shares out the programs of a dataset, and lists the labels of their parts."""
    return f"{dataset}-assignment"


def _reads(plan: Plan) -> tuple[str, ...]:
    return (f"shapeassembly/{assignment_name(plan.config.name)}",)


def _speaker(task: Task) -> ProgramDecoder:
    listed = task.input("shapeassembly", f"{assignment_name(task.config.name)}.labels.json")
    return ProgramDecoder(json.loads(listed.read_bytes()))


def _anew(places: DatasetPaths) -> RebuildShape:
    """The executed program, its labels those of its category as the dataset lists them."""
    labels: dict[str, list[str]] = {}
    path = places.out / places.dataset / "classes.json"
    for each in json.loads(path.read_bytes()) if path.is_file() else ():
        labels.setdefault(each["kit"], []).append(each["name"])
    return lambda record, _: upright(shape_of_text(record["text"], labels.get(record["kit"], ())))


LANGUAGE = Language(
    name="shapeassembly",
    reads=_reads,
    decoder=_speaker,
    graphs=False,
    text="Its ShapeAssembly program.",
    rebuild=_anew,
    coordinates="The unit is that of the program. The middle of its bounding box is the origin, and the middle of each "
    "cuboid is the origin of its mesh.",
)
