"""The language of shape programs: a sample is the parameters of a program, from which the program builds its shape."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.programs.program import find_program, shape_from_text
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright


class ParameterDecoder:
    """Builds the shapes of samples of programs."""

    def __init__(self, names: Sequence[str]) -> None:
        self.sources = {name: Source(find_program(name).labels) for name in names}

    def shape(self, sample: Sample) -> Shape:
        """Build the shape of the program `sample.kit` from the parameters in `sample.text`. Raises ParameterError."""
        return shape_from_text(sample.kit, sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Nothing: a program has no exemplars."""
        return ()


def _reads(_: Plan) -> tuple[str, ...]:
    return ()


def _decoder(task: Task) -> ParameterDecoder:
    return ParameterDecoder([entry.program for entry in task.config.section(ProgramsConfig).sampled])


def _rebuild(_: DatasetPaths) -> RebuildShape:
    return lambda record, _: upright(shape_from_text(record["kit"], record["text"]))


LANGUAGE = Language(
    name="program",
    reads=_reads,
    decoder=_decoder,
    graphs=False,
    text="Its parameters as JSON.",
    rebuild=_rebuild,
    coordinates="The origin and the unit of a shape are those of its program. The origin of a mesh is the middle of "
    "its bounding box, and poses only translate.",
)
