"""Recovery of what no program made, or not so: spoilt clouds and drawings, and shapes from elsewhere (geocode §4.4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from eval.engine.table import Cell, Table
from eval.recovery.accuracy import MEASURED, Found, published_chamfer
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

WAYS = ("network", "network, refined")


def _noisy(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    return points + rng.normal(0.0, 0.01 * frame_of(points).size, points.shape)


def _with_outliers(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    frame, strays = frame_of(points), len(points) // 20
    return np.concatenate([points[strays:], frame.placed(rng.uniform(-0.6, 0.6, (strays, 3)))])


def _ranks(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """How far each point is along a random direction, from 0 to 1 by rank."""
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
    """Without a third of its squares of eight pixels."""
    kept = np.kron(rng.random((-(-len(ink) // 8), -(-ink.shape[1] // 8))) < 2 / 3, np.ones((8, 8), np.bool_))
    return ink & kept[: len(ink), : ink.shape[1]]


def _wobbly(ink: BoolArray, rng: np.random.Generator) -> BoolArray:
    """Moved by three pixels about, as a hand wavers."""
    from scipy.ndimage import gaussian_filter

    drift = np.stack([gaussian_filter(rng.standard_normal(ink.shape), 12) for _ in range(2)])
    drift *= 3.0 / np.abs(drift).std()
    rows, columns = np.nonzero(ink)
    moved = np.zeros_like(ink)
    at = np.stack([rows, columns]) + np.rint(drift[:, rows, columns]).astype(int)
    inside = ((at >= 0) & (at < np.array(ink.shape)[:, None])).all(axis=0)
    moved[at[0, inside], at[1, inside]] = True
    return moved


Spoil = Callable[[RecoveryInput, np.random.Generator], RecoveryInput]


def _of_cloud(change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> Spoil:
    def spoil(given: RecoveryInput, rng: np.random.Generator) -> RecoveryInput:
        assert given.points is not None
        return replace(given, points=change(given.points, rng))

    return spoil


def _of_drawing(change: Callable[[BoolArray, np.random.Generator], BoolArray]) -> Spoil:
    def spoil(given: RecoveryInput, rng: np.random.Generator) -> RecoveryInput:
        assert given.ink is not None
        return replace(given, ink=change(given.ink, rng))

    return spoil


CORRUPTIONS: Mapping[str, Mapping[str, Spoil]] = {
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
"""What is done to inputs of each kind, by name."""


VIEWS: Mapping[str, tuple[float, float]] = {
    "nearly from the front": (8.0, 15.0),
    "other side, from above": (-50.0, 50.0),
}
"""Where drawings are seen from that no model has learnt: degrees around, and above, or below what hangs."""


def ways_to_spoil(kind: str) -> tuple[str, ...]:
    """What `spoilt_inputs` does to inputs of a kind, by name."""
    return (*CORRUPTIONS[kind], *(VIEWS if kind == "sketch" else ()))


def spoilt_inputs(
    model: TrainedRecovery, how: str, shapes: Sequence[RandomShape], inputs: Sequence[RecoveryInput], seed: int
) -> list[RecoveryInput]:
    """All inputs, which are of `shapes`, spoilt in one of the ways of their kind; or drawn from another side than the
    model has learnt."""
    kind = model.entry.input
    if how in CORRUPTIONS[kind]:
        spoil = CORRUPTIONS[kind][how]
        return [spoil(given, np.random.default_rng((seed, place))) for place, given in enumerate(inputs)]
    azimuth, elevation = VIEWS[how]
    side = 1.0 if model.program.view_elevation > 0 else -1.0
    view = model.sketches.views[0].model_copy(update={"azimuth": azimuth, "elevation": side * elevation})
    rng = np.random.default_rng(seed)
    inks = [draw_fitted(model.program, each.parts, view, model.sketches, rng) for each in shapes]
    return [replace(given, ink=ink) for given, ink in zip(inputs, inks, strict=True)]


def spoilt_table(found: Sequence[Found]) -> Table:
    """One row a method and way to spoil; `found` is of `eval.recovery.accuracy.tried`."""
    rows = tuple(
        (
            each.label,
            len(each.distances),
            float(each.distances.mean()),
            float(np.median(each.distances)),
            sum(result.missing > 0.0 for result in each.results),
        )
        for each in found
    )
    notes = (
        "Held-out shapes as clouds and drawings that were spoilt: chamfer is from the shape that was recovered to the "
        "true one, not to what was seen of it, as in the table of recovery. Noise: standard deviation in sides of the "
        "box. Broken: a third of the squares of eight pixels is blank. partial: how many clouds were said "
        "to be a part of the shape that was found; without search none is. The published sets out of the distribution "
        "(AmateurSketch, ProSketch, ScanNet, ShapeNet) are not to be had here.",
    )
    return Table("Recovery of spoilt inputs", ("input", "shapes", "chamfer", "median", "partial"), rows, notes)


def foreign_inputs(folder: Path, kind: str) -> list[RecoveryInput]:
    """The inputs of a kind in a folder, or a file. Raises ConfigError for one that cannot be read, or for none."""
    found = []
    for given in read_inputs(folder):
        if isinstance(given, InputError):
            raise ConfigError(str(given))
        if (given.ink is None) == (kind == "points"):
            found.append(given)
    return found


def foreign_rows(
    model: TrainedRecovery, inputs: Sequence[RecoveryInput], budget: int, seed: int
) -> list[tuple[str, list[float], list[RecoveryResult]]]:
    """For the base shape, the network and its refinement: the distance of each cloud from the shape that comes out,
    and what came out."""
    program, name = model.program, model.header["program"]
    known: RecoveryModels = {(name, model.entry.input): model}
    rows = []
    for way, models, shapes in (("base shape", {}, 1), (WAYS[0], known, 1), (WAYS[1], known, budget)):
        distances, results = [], []
        for given in inputs:
            found = recover_input(given, name, models, "", shapes, seed)
            results.append(found)
            if given.points is None or found.placement is None:
                distances.append(found.distance)
                continue
            made = sample_points(program.parts(found.values), MEASURED, np.random.default_rng(0))
            placed = made @ found.placement[:3, :3].T + found.placement[:3, 3]
            distances.append(published_chamfer(given.points, placed))
        rows.append((way, distances, results))
    return rows


def foreign_table(rows: Sequence[tuple[str, Sequence[float], Sequence[RecoveryResult]]]) -> Table:
    """One row a method and folder; `rows`: a label and what `foreign_rows` found for it."""
    cells: list[tuple[Cell, ...]] = []
    for label, distances, results in rows:
        warned = sum(any("unlike any" in text for text in each.warnings) for each in results)
        cells.append((label, len(distances), float(np.mean(distances)), float(np.median(distances)), warned))
    notes = (
        "Shapes that no program of ours made. chamfer: of clouds from the input itself, as published; of drawings from "
        "its ink, in sides of its box. told: how many were said to be unlike anything that the program makes.",
    )
    columns = ("input", "inputs", "chamfer", "median", "told")
    return Table("Recovery of shapes from elsewhere", columns, tuple(cells), notes)
