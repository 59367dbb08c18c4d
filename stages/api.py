"""The front door for scripts and notebooks: kits, variants, programs, datasets, models, recovery, pictures.

Everything is imported when it is first used, so `from stages import api` costs nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stages.package.reader import Dataset
    from stages.programs.program import Program
    from stages.recovery.result import RecoveryResult
    from stages.shape.arrays import ByteArray, FloatArray
    from stages.shape.kit import Kit
    from stages.shape.shape import Shape
    from stages.shapeassembly.syntax.program import AssemblyProgram as ShapeAssemblyProgram
    from stages.training.load import TrainedModel

MAX_SHAPES_TRIED = 600
"""Shapes that `recover` makes of a program, at most."""


def read_kit(models: str | Path | Sequence[str | Path], name: str = "kit", **settings: Any) -> Kit:
    """Read a kit from model files: a path, a pattern such as `castle/*.glb`, or a list of paths.

    settings: keys of `exemplars.kits[]`, such as `grammar="multiset"`; what is left out is resolved as in a run.
    Raises ConfigError for files that are missing or cannot be read and for settings that do not exist.
    """
    from pydantic import ValidationError

    from pipeline.config import mistakes_in_words
    from pipeline.errors import ConfigError
    from stages.autoconfig.resolved_kit import read_and_resolve
    from stages.autoconfig.settings import AutoconfigConfig
    from stages.exemplars.settings import ExemplarsConfig, KitConfig

    stated = {"name": name, "shapes": list(map(str, _paths(models))), **settings}
    try:
        config = KitConfig.model_validate_json(json.dumps(stated, default=str))  # it takes lists, as configs do
    except ValidationError as error:
        raise ConfigError("\n".join(mistakes_in_words(KitConfig, error, stated, "exemplars"))) from None
    reading = read_and_resolve(config, ExemplarsConfig().limits, AutoconfigConfig().max_tries, ())
    observed = reading.observe(reading.resolution.values)
    if observed.refusals:
        raise ConfigError("\n".join(observed.refusals))
    return observed.kit


def vary(kit: Kit, count: int, seed: int = 0) -> list[Shape]:
    """Make up to `count` new shapes from the parts of a kit; equal seeds make equal shapes."""
    import numpy as np

    from stages.shape.shape import kit_shape
    from stages.variations.vary import vary as make_variants

    return [kit_shape(kit, assembly) for assembly in make_variants(kit, count, np.random.default_rng(seed))]


@dataclass(frozen=True)
class ParametricProgram:
    """A program that can be called: parameter values in, a shape out."""

    definition: Program

    def __call__(self, values: Mapping[str, Any] | None = None, **named: Any) -> Shape:
        """Return the shape at some parameter values; the others keep their base value.

        Names with a space are given in `values`. Raises ValueError for unknown parameters, values outside their
        range, and values that break a constraint of the program.
        """
        from stages.programs.program import build_shape

        complete = self.definition.schema.complete({**(values or {}), **named})
        violated = self.definition.violated(complete)
        if violated:
            raise ValueError(f"{self.definition.name}: {'; '.join(constraint.name for constraint in violated)}")
        return build_shape(self.definition, complete)


def program(name: str) -> ParametricProgram:
    """Return a parametric program by its name, such as `chair`, or by its module. Raises ConfigError for neither."""
    from stages.programs.program import find_program

    return ParametricProgram(find_program(name))


def parse(text: str) -> ShapeAssemblyProgram:
    """Parse a ShapeAssembly program. Raises ProgramError with line, column and reason."""
    from stages.shapeassembly import parse as parse_program

    return parse_program(text)


def execute(parsed: ShapeAssemblyProgram) -> Shape:
    """Execute a parsed ShapeAssembly program: one box for each leaf cuboid. Raises ProgramError."""
    from stages.shapeassembly import execute as execute_program
    from stages.shapeassembly.shape import shape_of_execution

    return shape_of_execution(execute_program(parsed))


def open_dataset(location: str | Path) -> Dataset:
    """Open a finished dataset in a folder, or at a URL such as `s3://bucket/castle`.

    Raises ConfigError where its manifest is missing.
    """
    from stages.package.reader import Dataset

    return Dataset.open(location)


def load_model(folder: str | Path, kit: Kit | None = None) -> TrainedModel:
    """Load a trained model from its folder or its `weights.safetensors`; the header says which kind it is.

    kit: the kit that a model of edge categories was trained on; only these need one.
    Raises CheckpointError for weights that are missing, damaged or of an unknown kind.
    """
    from stages.training.load import load_model as load

    return load(Path(folder), kit=kit)


def recover(source: str | Path | FloatArray | ByteArray, program: str = "", seed: int = 0) -> RecoveryResult:
    """Find the parameters of a program whose shape is most like a scan or a drawing.

    source: a file (a cloud, a mesh or a picture); a cloud, float (n, 3); or a drawing, uint8 (h, w) or (h, w, 3).
    program: its name; empty for the program that fits best. Raises InputError for an input that cannot be read.
    """
    from stages.recovery.reading import read_inputs
    from stages.recovery.recover import recover as recover_array
    from stages.recovery.recover import recover_input
    from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models

    models, _ = find_models(PRETRAINED_FOLDER)
    if not isinstance(source, str | Path):
        return recover_array(source, program, models, seed=seed)
    given = next(iter(read_inputs(Path(source))))
    if isinstance(given, Exception):
        raise given
    return recover_input(given, program, models, "", MAX_SHAPES_TRIED, seed)


def render(shape: Shape, path: str | Path, size: tuple[int, int] = (640, 640)) -> None:
    """Write a shaded picture of a shape as PNG; `size` is width and height in pixels."""
    from pipeline.paths import write_file
    from stages.shape.views.picture import shape_png

    write_file(Path(path), shape_png(shape, size=size))


def _paths(models: str | Path | Sequence[str | Path]) -> list[Path]:
    """Return the files that a path, a pattern or a list names, in order."""
    listed = [models] if isinstance(models, str | Path) else list(models)
    paths: list[Path] = []
    for entry in map(Path, listed):
        if any(letter in str(entry) for letter in "*?["):
            paths += sorted(Path(entry.anchor or ".").glob(str(entry.relative_to(entry.anchor))))
        else:
            paths.append(entry)
    return paths
