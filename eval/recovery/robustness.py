"""Robustness of recovery: corrupted clouds and drawings, and shapes from other sources (geocode §4.4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from eval.engine.table import Cell, Table
from eval.recovery.methods import POINTS_PER_SHAPE, MethodResults, published_chamfer
from pipeline.errors import ConfigError
from stages.recovery.inputs import InputError, RecoveryInput
from stages.recovery.reading import read_inputs
from stages.recovery.recover import recover_input
from stages.recovery.result import RecoveryResult
from stages.shape.arrays import BoolArray, FloatArray
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.drawings import draw_fitted
from stages.training.recovery.shapes import RandomShape
from stages.training.recovery.surface import sample_points
from stages.training.recovery.trained import RecoveryModels, TrainedRecovery

METHOD_NAMES = ("network", "network, refined")


def _noisy(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    return points + rng.normal(0.0, 0.01 * frame_of(points).size, points.shape)


def _with_outliers(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    frame, outliers = frame_of(points), len(points) // 20
    return np.concatenate([points[outliers:], frame.placed(rng.uniform(-0.6, 0.6, (outliers, 3)))])


def _ranks(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the rank of each point along a random direction, from 0 to 1."""
    order = np.argsort(points @ rng.standard_normal(3))
    ranks = np.empty(len(points))
    ranks[order] = np.linspace(0.0, 1.0, len(points))
    return ranks


def _half(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    return points[_ranks(points, rng) >= 0.5]


def _uneven(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    return points[rng.random(len(points)) < 0.05 + 0.95 * _ranks(points, rng)]


def _few(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    return subsample(points, 300, rng)


def _thick(ink: BoolArray, _: np.random.Generator) -> BoolArray:
    from scipy.ndimage import binary_dilation

    thick: BoolArray = binary_dilation(ink, np.ones((5, 5), np.bool_))
    return thick


def _broken(ink: BoolArray, rng: np.random.Generator) -> BoolArray:
    """Blank a third of the squares of eight pixels."""
    kept = np.kron(rng.random((-(-len(ink) // 8), -(-ink.shape[1] // 8))) < 2 / 3, np.ones((8, 8), np.bool_))
    return ink & kept[: len(ink), : ink.shape[1]]


def _wobbly(ink: BoolArray, rng: np.random.Generator) -> BoolArray:
    """Displace lines by about three pixels, as a shaky hand does."""
    from scipy.ndimage import gaussian_filter

    drift = np.stack([gaussian_filter(rng.standard_normal(ink.shape), 12) for _ in range(2)])
    drift *= 3.0 / np.abs(drift).std()
    rows, columns = np.nonzero(ink)
    moved = np.zeros_like(ink)
    target = np.stack([rows, columns]) + np.rint(drift[:, rows, columns]).astype(int)
    inside = ((target >= 0) & (target < np.array(ink.shape)[:, None])).all(axis=0)
    moved[target[0, inside], target[1, inside]] = True
    return moved


Corruption = Callable[[RecoveryInput, np.random.Generator], RecoveryInput]


def _of_cloud(change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> Corruption:
    def corrupt(given: RecoveryInput, rng: np.random.Generator) -> RecoveryInput:
        assert given.points is not None
        return replace(given, points=change(given.points, rng))

    return corrupt


def _of_drawing(change: Callable[[BoolArray, np.random.Generator], BoolArray]) -> Corruption:
    def corrupt(given: RecoveryInput, rng: np.random.Generator) -> RecoveryInput:
        assert given.ink is not None
        return replace(given, ink=change(given.ink, rng))

    return corrupt


CORRUPTIONS: Mapping[str, Mapping[str, Corruption]] = {
    "points": {
        "noise of 1 %": _of_cloud(_noisy),
        "5 % outliers": _of_cloud(_with_outliers),
        "half missing": _of_cloud(_half),
        "uneven": _of_cloud(_uneven),
        "300 points": _of_cloud(_few),
    },
    "sketch": {
        "thick lines": _of_drawing(_thick),
        "broken lines": _of_drawing(_broken),
        "wobbly lines": _of_drawing(_wobbly),
    },
}
"""By kind of input and name."""

UNSEEN_VIEWS: Mapping[str, tuple[float, float]] = {
    "nearly from the front": (8.0, 15.0),
    "other side, from above": (-50.0, 50.0),
}
"""Azimuth and elevation in degrees; from below for hanging shapes."""


def corruption_names(kind: str) -> tuple[str, ...]:
    """Return the names of the corruptions of a kind of input."""
    return (*CORRUPTIONS[kind], *(UNSEEN_VIEWS if kind == "sketch" else ()))


def corrupted_inputs(
    model: TrainedRecovery, name: str, shapes: Sequence[RandomShape], inputs: Sequence[RecoveryInput], seed: int
) -> list[RecoveryInput]:
    """Corrupt the inputs of `shapes`, or draw them from an unseen view."""
    kind = model.entry.input
    if name in CORRUPTIONS[kind]:
        corrupt = CORRUPTIONS[kind][name]
        return [corrupt(given, np.random.default_rng((seed, number))) for number, given in enumerate(inputs)]
    azimuth, elevation = UNSEEN_VIEWS[name]
    side = 1.0 if model.program.view_elevation > 0 else -1.0
    view = model.sketches.views[0].model_copy(update={"azimuth": azimuth, "elevation": side * elevation})
    rng = np.random.default_rng(seed)
    inks = [draw_fitted(model.program, shape.parts, view, model.sketches, rng) for shape in shapes]
    return [replace(given, ink=ink) for given, ink in zip(inputs, inks, strict=True)]


def corruption_table(results: Sequence[MethodResults]) -> Table:
    """Return one row for each method and corruption."""
    rows = tuple(
        (
            result.label,
            len(result.distances),
            float(result.distances.mean()),
            float(np.median(result.distances)),
            sum(recovered.missing > 0.0 for recovered in result.results),
        )
        for result in results
    )
    notes = (
        "Held-out shapes as corrupted clouds and drawings. chamfer: from the recovered shape to the true one, not to "
        "the input, as in the table of recovery. Noise: standard deviation in sides of the box. Broken: a third of the "
        "squares of eight pixels is blank. partial: clouds detected as partial scans, which needs search. The "
        "published out-of-distribution sets (AmateurSketch, ProSketch, ScanNet, ShapeNet) are not available.",
    )
    return Table("Recovery of corrupted inputs", ("input", "shapes", "chamfer", "median", "partial"), rows, notes)


def external_inputs(folder: Path, kind: str) -> list[RecoveryInput]:
    """Read the inputs of a kind in a folder or file. Raises ConfigError for one that cannot be read, or for none."""
    inputs = []
    for given in read_inputs(folder):
        if isinstance(given, InputError):
            raise ConfigError(str(given))
        if (given.ink is None) == (kind == "points"):
            inputs.append(given)
    return inputs


def external_rows(
    model: TrainedRecovery, inputs: Sequence[RecoveryInput], budget: int, seed: int
) -> list[tuple[str, list[float], list[RecoveryResult]]]:
    """Return name, distances and results of the base shape, the network and the refined network.

    Distances of clouds are to the recovered shapes; those of drawings are the results' own.
    """
    program, name = model.program, model.header["program"]
    network: RecoveryModels = {(name, model.entry.input): model}
    methods: Sequence[tuple[str, RecoveryModels, int]] = (
        ("base shape", {}, 1),
        (METHOD_NAMES[0], network, 1),
        (METHOD_NAMES[1], network, budget),
    )
    rows = []
    for method, models, shapes in methods:
        distances, results = [], []
        for given in inputs:
            result = recover_input(given, name, models, "", shapes, seed)
            results.append(result)
            if given.points is None or result.placement is None:
                distances.append(result.distance)
                continue
            points = sample_points(program.parts(result.values), POINTS_PER_SHAPE, np.random.default_rng(0))
            placed = points @ result.placement[:3, :3].T + result.placement[:3, 3]
            distances.append(published_chamfer(given.points, placed))
        rows.append((method, distances, results))
    return rows


def external_table(rows: Sequence[tuple[str, Sequence[float], Sequence[RecoveryResult]]]) -> Table:
    """Return one row for each method and folder: a label, and distances and results of `external_rows`."""
    cells: list[tuple[Cell, ...]] = []
    for label, distances, results in rows:
        warned = sum(any("unlike any" in text for text in result.warnings) for result in results)
        cells.append((label, len(distances), float(np.mean(distances)), float(np.median(distances)), warned))
    notes = (
        "Shapes from other sources. chamfer: of clouds, to the input, as published; of drawings, to its ink, in sides "
        "of its box. warned: inputs reported as unlike anything that the program makes.",
    )
    columns = ("input", "inputs", "chamfer", "median", "warned")
    return Table("Recovery of external shapes", columns, tuple(cells), notes)
