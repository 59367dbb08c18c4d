"""How near do recovered shapes come to the true ones, and which parameters are right? (geocode §4.2, Tables 2 and 3)"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from eval.engine.table import Cell, ReferenceRow, Table
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
from stages.training.recovery.shapes import TEST_INTERVAL, TRAIN_INTERVAL, RandomShape, random_shapes
from stages.training.recovery.surface import sample_points, shape_points
from stages.training.recovery.trained import PRETRAINED_FOLDER, RecoveryModels, TrainedRecovery, find_models

MEASURED = 10_000
"""Points that Chamfer distances are measured with."""
GIVEN = 2048
"""Points of a cloud that is recovered."""
NEIGHBORS, GLIMPSE = 1000, 256
"""Training shapes that the nearest is looked for among, and the points of each."""

PUBLISHED = (
    *(
        ReferenceRow(f"{program}, {method}", f"geocode, Table 2, sketch, {angle}", {"chamfer": figure})
        for program, method, trained, novel in (
            ("chair", "Huang et al.", 2.142e-3, 8.030e-3),
            ("chair", "GeoCode", 1.057e-3, 8.075e-3),
            ("vase", "Huang et al.", 4.328e-3, 9.271e-3),
            ("vase", "GeoCode", 4.875e-3, 9.788e-3),
            ("table", "Huang et al.", 4.051e-3, 9.667e-3),
            ("table", "GeoCode", 2.497e-3, 8.533e-3),
            ("ceiling lamp", "Huang et al.", 1.361e-2, 2.236e-2),
            ("ceiling lamp", "GeoCode", 1.403e-2, 2.272e-2),
        )
        for angle, figure in (("trained angles", trained), ("novel angle", novel))
    ),
    *(
        ReferenceRow(f"chair, {method}", f"geocode, Table 3, {given}", {"chamfer": figure})
        for method, points, sketch in (("classification", 4.0e-4, 1.06e-3), ("regression", 1.98e-3, 3.64e-3))
        for given, figure in (("point cloud", points), ("sketch", sketch))
    ),
)


Method = Callable[[RecoveryInput], RecoveryResult]


@dataclass(frozen=True)
class Found:
    """What a method made of some inputs. results: of each; distances: as published, float64 (n,); exact, near: bool
    (n, parameters), right and within one class; visible: bool (n, parameters), what is seen in the truth; seconds: for
    an input."""

    label: str
    program: Program
    results: tuple[RecoveryResult, ...]
    distances: FloatArray
    exact: BoolArray
    near: BoolArray
    visible: BoolArray
    seconds: float


def published_chamfer(first: FloatArray, second: FloatArray) -> float:
    """The mean squared distance to the nearest, the mean of both ways, of clouds (n, 3) that are each brought into the
    unit sphere around the middle of its box: as the published code measures."""
    return chamfer_squared(_in_sphere(first), _in_sphere(second)) / 2.0


def held_out(
    model: TrainedRecovery, count: int, rng: np.random.Generator
) -> Iterator[tuple[str, list[RandomShape], list[RecoveryInput]]]:
    """`count` shapes that no model has learnt from, as clouds; or as drawings from the views that the model has learnt,
    in turns, and once more from those that it has not."""
    shapes = list(islice(random_shapes(model.program, TEST_INTERVAL, rng), count))
    names = [f"{number:03}" for number in range(count)]
    if model.entry.input == "points":
        clouds = [sample_points(each.parts, GIVEN, rng) for each in shapes]
        yield "points", shapes, [RecoveryInput(name, points=each) for name, each in zip(names, clouds, strict=True)]
        return
    learnt = [each for each in model.sketches.views if not model.entry.views or each.name in model.entry.views]
    novel = [each for each in model.sketches.views if each not in learnt]
    for angle, views in (("trained angles", learnt), ("novel angle", novel)):
        if views:
            inks = [
                draw_fitted(model.program, each.parts, views[place % len(views)], model.sketches, rng)
                for place, each in enumerate(shapes)
            ]
            yield (
                f"sketch, {angle}",
                shapes,
                [RecoveryInput(name, ink=each) for name, each in zip(names, inks, strict=True)],
            )


def usable_models(folder: Path, programs: Collection[str]) -> RecoveryModels:
    """The recovery models in a folder of published models, and of those that come with Shapemill where it has none; of
    `programs`, if any are named. Raises ConfigError where that leaves none."""
    models, wrong = find_models(folder, PRETRAINED_FOLDER)
    asked = {key: model for key, model in models.items() if not programs or model.program.name in programs}
    if not asked:
        told = f"no recovery model of {', '.join(programs)}" if programs else "; ".join(wrong)
        raise ConfigError(f"{told}; make train")
    return asked


def methods(model: TrainedRecovery, budget: int, seed: int) -> dict[str, Method]:
    """The ways from an upright input to a shape, by name; the nearest training shape for clouds alone."""
    program, kind = model.program, model.entry.input
    key = (model.header["program"], kind)

    def recovered(models: RecoveryModels, shapes: int) -> Method:
        return lambda given: recover_input(given, key[0], models, "y", shapes, seed, turned=False)

    found = {
        "base shape": recovered({}, 1),
        "base shape, refined": recovered({}, budget),
        "network": recovered({key: model}, 1),
        "network, refined": recovered({key: model}, budget),
    }
    if kind == "points":
        found["nearest training shape"] = _nearest(program, np.random.default_rng(seed))
    return found


def tried(
    label: str, program: Program, method: Method, shapes: Sequence[RandomShape], inputs: Sequence[RecoveryInput]
) -> Found:
    """What a method makes of inputs, against the shapes that they are of."""
    counts = np.array([len(each.values) for each in program.parameters])
    distances, classes, results = [], [], []
    seconds = 0.0
    for shape, given in zip(shapes, inputs, strict=True):
        began = time.process_time()
        results.append(method(given))
        values = results[-1].values
        seconds += time.process_time() - began
        clouds = [
            sample_points(parts, MEASURED, np.random.default_rng(side))
            for side, parts in enumerate((shape.parts, program.parts(values)))
        ]
        distances.append(published_chamfer(*clouds))
        classes.append(program.schema.to_classes(values))
    found, truth = np.array(classes), np.array([each.classes for each in shapes])
    near = (np.abs(found - truth) <= 1) & (found < counts)
    shares = np.array(distances), found == truth, near, truth < counts
    return Found(label, program, tuple(results), *shares, seconds / len(inputs))


def floor(program: Program, shapes: Sequence[RandomShape]) -> FloatArray:
    """How far true shapes are from themselves, by chance, float64 (n,)."""
    pairs = ([sample_points(each.parts, MEASURED, np.random.default_rng(side)) for side in (0, 1)] for each in shapes)
    return np.array([published_chamfer(*pair) for pair in pairs])


def recovery_table(found: Sequence[Found], floors: Mapping[str, float], budget: int) -> Table:
    """One row a method and kind of input; methods of one kind of input stand together, the network's first guess among
    them."""
    rows: list[tuple[Cell, ...]] = []
    programs = {each.program.name for each in found}
    first = {each.label.partition(": ")[0]: each for each in found if each.label.endswith(": network")}
    for each in found:
        guess = first[each.label.partition(": ")[0]]
        many = len(each.distances)
        rows.append(
            (
                each.label,
                many,
                float(each.distances.mean()),
                float(np.median(each.distances)),
                100.0 * float(each.exact[each.visible].mean()),
                100.0 * float(each.near[each.visible].mean()),
                "" if each is guess else _significance(each.distances, guess.distances[:many]),
                float(guess.distances[:many].mean()),
                each.seconds,
            )
        )
    rows += [(name, "", value) + ("",) * 6 for name, value in floors.items()]
    return Table(
        "Shapes recovered from shapes that were not learnt from",
        ("input", "shapes", "chamfer", "median", "exact %", "near %", "p", "network on these", "seconds"),
        tuple(rows),
        notes=(
            f"chamfer: mean squared distance to the nearest of {MEASURED:,} points, the mean of both ways, each shape "
            "in the unit sphere around the middle of its box, as the published code measures. exact, near: of the "
            "parameters that are seen in the true shape, those that are right, and those within one class. p: of a "
            "paired t-test against the network's first guess of the same shapes, whose mean stands beside it. Seconds: "
            f"of one core. Refined: a search with {budget} shapes at most, for the first few of them. True shape: what "
            "is left where two samples of one shape are compared.",
            "Published figures are of the published programs, shapes and drawings; ours of ours. The published sets "
            "out of the distribution (AmateurSketch, ProSketch, ScanNet, ShapeNet) are not to be had here.",
        ),
        published=[each for each in PUBLISHED if each.name.partition(",")[0].replace(" ", "_") in programs],
    )


def baselines_table(found: Sequence[Found], steps: Mapping[str, int]) -> Table:
    """One row a model, the first being what the others are compared with; steps: of its training, by label."""
    rows: list[tuple[Cell, ...]] = [
        (
            each.label,
            steps[each.label],
            float(each.distances.mean()),
            float(np.median(each.distances)),
            100.0 * float(each.exact[each.visible].mean()),
            100.0 * float(each.near[each.visible].mean()),
            _significance(each.distances, found[0].distances),
        )
        for each in found
    ]
    notes = (
        f"First guesses, without search, of {len(found[0].distances)} held-out shapes, the same for all models. "
        "chamfer, exact, near: as in the table of recovery. p: of a paired t-test against the first row. classes: a "
        "class for each value; regression: continuous parameters are regressed; two-encoders: by a network of their "
        "own (Huang et al. 2017); no-hidden-class: there is no class for hidden parameters (no existence label).",
    )
    published = [each for each in PUBLISHED if "Table 3" in each.source]
    columns = ("model", "steps", "chamfer", "median", "exact %", "near %", "p")
    return Table("Ways to answer, at equal training", columns, tuple(rows), notes, published)


def alike(found: Found, shapes: Sequence[RandomShape]) -> BoolArray:
    """Which parameters of the first of the inputs, those of `shapes`, are as good as right, bool (shapes, parameters):
    in the true shape the value that was found moves the surface by no more than a quarter of a percent of the diagonal.
    """
    same = found.exact[: len(shapes)].copy()
    for row, shape in enumerate(shapes):
        asked = np.flatnonzero(found.visible[row] & ~same[row])
        names = [found.program.parameters[place].name for place in asked.tolist()]
        changes = [{name: found.results[row].values[name]} for name in names]
        same[row, asked] = surface_movements(found.program, shape.values, changes) <= MIN_CLASS_MOVEMENT
    return same


def parameters_table(found: Mapping[str, tuple[Found, BoolArray]]) -> Table:
    """One row a kind of input: `found` by its name, with what `alike` says of its first shapes."""
    rows: list[tuple[Cell, ...]] = []
    for name, (each, same) in found.items():
        seen = each.visible[: len(same)]
        shown = seen.sum(axis=0)
        wrong = (seen & ~same).sum(axis=0) / np.maximum(shown, 1) * (shown > 1)
        worst = [each.program.parameters[place].name for place in np.argsort(-wrong, kind="stable")[:4].tolist()]
        shares = (100.0 * float(right[: len(same)][seen].mean()) for right in (each.exact, each.near, same))
        rows.append((name, len(same), *shares, ", ".join(worst)))
    notes = (
        "Of the network alone; of the parameters that are seen in the true shape. alike: right, or wrong by so little "
        f"that in the true shape it moves no point of the surface by more than {MIN_CLASS_MOVEMENT:.2%}"
        " of the diagonal, which no "
        "cloud or drawing tells. Most often unlike: the parameters of which that is rarest. Inputs have no size: what "
        "makes a shape larger as a whole, its height and widths together, only what does not grow with it tells.",
    )
    columns = ("input", "shapes", "exact %", "near %", "alike %", "most often unlike")
    return Table("Parameters that are right, or as good as right", columns, tuple(rows), notes)


def accuracy_chart(found: Sequence[Found], same: BoolArray) -> bytes:
    """A bar a parameter, as PNG: the share that is right where it is seen, dark, and that within one class, light; a
    panel for each of `found`, which are of one program. In the first a mark says which share is as good as right:
    `same` is what `alike` says of it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [each.name for each in found[0].program.parameters]
    figure = Figure(figsize=(1.2 + 3.4 * len(found), 0.6 + 0.17 * len(names)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    places = np.arange(len(names))
    panels = figure.subplots(1, len(found), squeeze=False, sharey=True)[0]
    for panel, each in zip(panels, found, strict=True):
        seen = each.visible.sum(axis=0)
        for right, color in ((each.near, "#b7cbe0"), (each.exact, "#2f5f8f")):
            share = np.where(seen > 0, (right & each.visible).sum(axis=0) / np.maximum(seen, 1), 0.0)
            panel.barh(places, 100.0 * share, color=color)
        panel.set(xlabel="% right, within one class, | alike", xlim=(0, 100))
        panel.set_title(each.label, fontsize=7)
        panel.spines[["top", "right"]].set_visible(False)
    seen = found[0].visible[: len(same)]
    shown = np.flatnonzero(seen.any(axis=0))
    share = (same & seen).sum(axis=0)[shown] / seen.sum(axis=0)[shown]
    panels[0].plot(100.0 * share, places[shown], "|", color="#b04a2f", markersize=5)
    panels[0].set_yticks(places, names, fontsize=6)
    panels[0].invert_yaxis()
    stream = io.BytesIO()
    figure.savefig(stream, metadata={"Software": None})
    return stream.getvalue()


def _nearest(program: Program, rng: np.random.Generator) -> Method:
    """The values of that of some training shapes whose points are nearest."""

    @cache
    def known() -> list[tuple[Values, FloatArray]]:
        made = islice(random_shapes(program, TRAIN_INTERVAL, rng), NEIGHBORS)
        pairs = ((each.values, shape_points(each.parts, GLIMPSE)) for each in made)
        return [(values, frame_of(points).normalized(points)) for values, points in pairs]

    def method(given: RecoveryInput) -> RecoveryResult:
        assert given.points is not None
        points = frame_of(given.points).normalized(given.points[:GLIMPSE])
        distances = [chamfer_squared(points, each) for _, each in known()]
        values, _ = known()[int(np.argmin(distances))]
        return RecoveryResult(
            program, values, min(distances), min(distances), 0.0, None, None, None, "y", NEIGHBORS, ()
        )

    return method


def _in_sphere(points: FloatArray) -> FloatArray:
    centred = points - (points.min(axis=0) + points.max(axis=0)) / 2.0
    inside: FloatArray = centred / np.linalg.norm(centred, axis=1).max()
    return inside


def _significance(distances: FloatArray, others: FloatArray) -> Cell:
    from scipy.stats import ttest_rel

    if len(distances) < 2 or np.array_equal(distances, others):
        return ""
    return float(ttest_rel(distances, others).pvalue)
