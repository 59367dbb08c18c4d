"""The language of curve programs: a sample is a program's parameters, its shape is what the program makes of them."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.programs.program import find_program, shape_from_text
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright


class Parameters:
    """The program of the config."""

    def __init__(self, name: str) -> None:
        self.sources = {name: Source(find_program(name).labels)}

    def shape(self, sample: Sample) -> Shape:
        """The shape of the program called `sample.kit` at the parameters that `sample.text` says. Raises ParameterError
        for a text that is none of its own."""
        return shape_from_text(sample.kit, sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Nothing: a program begins with numbers."""
        return ()


def _reads(_: Plan) -> tuple[str, ...]:
    return ()


def _speaker(task: Task) -> Parameters:
    return Parameters(task.config.section(ProgramsConfig).program)


def _anew(_: DatasetPaths) -> RebuildShape:
    return lambda record, _: upright(shape_from_text(record["kit"], record["text"]))


LANGUAGE = Language(
    name="program",
    reads=_reads,
    decoder=_speaker,
    graphs=False,
    text="Its parameters as JSON.",
    rebuild=_anew,
    coordinates="The unit is about a metre. Shapes stand on the plane y = 0 around the y axis with their front to +z; "
    "what hangs from a ceiling hangs from that plane. The origin of a mesh is the middle of the box around the part, "
    "and poses turn nothing.",
)
