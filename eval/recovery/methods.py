"""Recovery methods, applied to held-out shapes (geocode §4.2)."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.programs.movement import MIN_CLASS_MOVEMENT, surface_movements
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.recovery.inputs import RecoveryInput
from stages.recovery.recover import recover_input
from stages.recovery.result import RecoveryResult
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.clouds import chamfer_squared
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.drawings import draw_fitted
from stages.training.recovery.shapes import TEST_INTERVAL, TRAIN_INTERVAL, RandomShape, random_training_shapes
from stages.training.recovery.surface import sample_points, shape_points
from stages.training.recovery.trained import PRETRAINED_FOLDER, RecoveryModels, TrainedRecovery, find_models

POINTS_PER_SHAPE = 10_000
"""For Chamfer distances."""
POINTS_PER_INPUT = 2048
NUM_TRAINING_SHAPES, POINTS_PER_TRAINING_SHAPE = 1000, 256
"""For the nearest training shape."""

RecoveryMethod = Callable[[RecoveryInput], RecoveryResult]


@dataclass(frozen=True)
class MethodResults:
    """The results of a method for n inputs of one program."""

    label: str
    program: Program
    results: tuple[RecoveryResult, ...]
    distances: FloatArray
    """Published Chamfer distances to the true shapes, float64 (n,)."""
    exact: BoolArray
    """Right parameters, bool (n, parameters)."""
    near: BoolArray
    """Parameters within one class, bool (n, parameters)."""
    visible: BoolArray
    """Parameters that the true shape shows, bool (n, parameters)."""
    seconds: float
    """Per input."""


def published_chamfer(first: FloatArray, second: FloatArray) -> float:
    """Return the Chamfer distance of the published code: squared, the mean of both directions.

    Clouds (n, 3) are scaled into the unit sphere around the centre of their boxes.
    """
    return chamfer_squared(_in_sphere(first), _in_sphere(second)) / 2.0


def _in_sphere(points: FloatArray) -> FloatArray:
    centred = points - (points.min(axis=0) + points.max(axis=0)) / 2.0
    inside: FloatArray = centred / np.linalg.norm(centred, axis=1).max()
    return inside


def held_out(
    model: TrainedRecovery, count: int, rng: np.random.Generator
) -> Iterator[tuple[str, list[RandomShape], list[RecoveryInput]]]:
    """Yield held-out shapes as inputs of a model, with a name: clouds, or drawings from trained and novel views."""
    shapes = list(islice(random_training_shapes(model.program, TEST_INTERVAL, rng), count))
    names = [f"{number:03}" for number in range(count)]
    if model.entry.input == "points":
        clouds = [sample_points(shape.parts, POINTS_PER_INPUT, rng) for shape in shapes]
        yield "points", shapes, [RecoveryInput(name, points=cloud) for name, cloud in zip(names, clouds, strict=True)]
        return
    views = model.sketches.views
    trained = [view for view in views if not model.entry.views or view.name in model.entry.views]
    novel = [view for view in views if view not in trained]
    for angle, of_angle in (("trained angles", trained), ("novel angle", novel)):
        if of_angle:
            inks = [
                draw_fitted(model.program, shape.parts, of_angle[number % len(of_angle)], model.sketches, rng)
                for number, shape in enumerate(shapes)
            ]
            inputs = [RecoveryInput(name, ink=ink) for name, ink in zip(names, inks, strict=True)]
            yield f"sketch, {angle}", shapes, inputs


def usable_models(folder: Path, programs: Collection[str]) -> RecoveryModels:
    """Return the recovery models of some programs, or of all if none are named.

    They come from a folder of published models, and from the pretrained ones where that has none. Raises ConfigError if
    there is no such model.
    """
    models, errors = find_models(folder, PRETRAINED_FOLDER)
    usable = {key: model for key, model in models.items() if not programs or model.program.name in programs}
    if not usable:
        reason = f"no recovery model of {', '.join(programs)}" if programs else "; ".join(errors)
        raise ConfigError(f"{reason}; make train")
    return usable


def methods(model: TrainedRecovery, budget: int, seed: int) -> dict[str, RecoveryMethod]:
    """Return the methods for upright inputs, by name; `nearest training shape` is for clouds only."""
    program, kind = model.program, model.entry.input
    key = (model.header["program"], kind)

    def recovery(models: RecoveryModels, shapes: int) -> RecoveryMethod:
        return lambda given: recover_input(given, key[0], models, "y", shapes, seed, turned=False)

    by_name = {
        "base shape": recovery({}, 1),
        "base shape, refined": recovery({}, budget),
        "network": recovery({key: model}, 1),
        "network, refined": recovery({key: model}, budget),
    }
    if kind == "points":
        by_name["nearest training shape"] = _nearest_training_shape(program, np.random.default_rng(seed))
    return by_name


def _nearest_training_shape(program: Program, rng: np.random.Generator) -> RecoveryMethod:
    @cache
    def training_shapes() -> list[tuple[Values, FloatArray]]:
        shapes = islice(random_training_shapes(program, TRAIN_INTERVAL, rng), NUM_TRAINING_SHAPES)
        pairs = ((shape.values, shape_points(shape.parts, POINTS_PER_TRAINING_SHAPE)) for shape in shapes)
        return [(values, frame_of(points).normalized(points)) for values, points in pairs]

    def method(given: RecoveryInput) -> RecoveryResult:
        assert given.points is not None
        points = frame_of(given.points).normalized(given.points[:POINTS_PER_TRAINING_SHAPE])
        distances = [chamfer_squared(points, other) for _, other in training_shapes()]
        values, _ = training_shapes()[int(np.argmin(distances))]
        return RecoveryResult(
            program, values, min(distances), min(distances), 0.0, None, None, None, "y", NUM_TRAINING_SHAPES, ()
        )

    return method


def apply_method(
    label: str, program: Program, method: RecoveryMethod, shapes: Sequence[RandomShape], inputs: Sequence[RecoveryInput]
) -> MethodResults:
    """Apply a method to inputs, and compare with their true shapes."""
    counts = np.array([len(parameter.values) for parameter in program.parameters])
    distances, classes, results = [], [], []
    seconds = 0.0
    for shape, given in zip(shapes, inputs, strict=True):
        start = time.process_time()
        results.append(method(given))
        values = results[-1].values
        seconds += time.process_time() - start
        clouds = [
            sample_points(parts, POINTS_PER_SHAPE, np.random.default_rng(side))
            for side, parts in enumerate((shape.parts, program.parts(values)))
        ]
        distances.append(published_chamfer(*clouds))
        classes.append(program.schema.to_classes(values))
    recovered, truth = np.array(classes), np.array([shape.classes for shape in shapes])
    near = (np.abs(recovered - truth) <= 1) & (recovered < counts)
    arrays = np.array(distances), recovered == truth, near, truth < counts
    return MethodResults(label, program, tuple(results), *arrays, seconds / len(inputs))


def sampling_floor(program: Program, shapes: Sequence[RandomShape]) -> FloatArray:
    """Return the distance of two samples of each true shape, float64 (n,)."""
    pairs = (
        [sample_points(shape.parts, POINTS_PER_SHAPE, np.random.default_rng(side)) for side in (0, 1)]
        for shape in shapes
    )
    return np.array([published_chamfer(*pair) for pair in pairs])


def indistinguishable_parameters(results: MethodResults, shapes: Sequence[RandomShape]) -> BoolArray:
    """Return which parameters of the first inputs, those of `shapes`, are as good as right, bool (shapes, parameters).

    Such a value moves the surface of the true shape by no more than a quarter of a percent of the diagonal.
    """
    same = results.exact[: len(shapes)].copy()
    for row, shape in enumerate(shapes):
        wrong = np.flatnonzero(results.visible[row] & ~same[row])
        names = [results.program.parameters[index].name for index in wrong.tolist()]
        changes = [{name: results.results[row].values[name]} for name in names]
        same[row, wrong] = surface_movements(results.program, shape.values, changes) <= MIN_CLASS_MOVEMENT
    return same
