"""How near do recovered shapes come to the true ones, and which parameters are right? (geocode §4.2, Tables 2 and 3)"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from eval.table import Cell, Published, Table
from pipeline.errors import ConfigError
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.arrays import BoolArray, FloatArray
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.drawings import drawn
from stages.training.recovery.reading import Input
from stages.training.recovery.recover import Models, find_models, recover_input
from stages.training.recovery.shapes import TEST, TRAIN, RandomShape, random_shapes
from stages.training.recovery.surface import chamfer_distance, sampled_points, shape_points
from stages.training.recovery.trained import TrainedRecovery

__all__ = [
    "PUBLISHED",
    "Found",
    "accuracy_chart",
    "floor",
    "held_out",
    "methods",
    "published_chamfer",
    "recovery_table",
    "tried",
    "usable_models",
]

MEASURED = 10_000
"""Points that Chamfer distances are measured with."""
GIVEN = 2048
"""Points of a cloud that is recovered."""
NEIGHBORS, GLIMPSE = 1000, 256
"""Training shapes that the nearest is looked for among, and the points of each."""

PUBLISHED = (
    *(
        Published(f"{program}, {method}", f"geocode, Table 2, sketch, {angle}", {"chamfer": figure})
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
        Published(f"chair, {method}", f"geocode, Table 3, {given}", {"chamfer": figure})
        for method, points, sketch in (("classification", 4.0e-4, 1.06e-3), ("regression", 1.98e-3, 3.64e-3))
        for given, figure in (("point cloud", points), ("sketch", sketch))
    ),
)


Method = Callable[[Input], Values]


@dataclass(frozen=True)
class Found:
    """What a method made of some inputs. distances: as published, float64 (n,); exact, near: bool (n, parameters),
    right and within one class; visible: bool (n, parameters), what is seen in the truth; seconds: for an input."""

    label: str
    program: Program
    distances: FloatArray
    exact: BoolArray
    near: BoolArray
    visible: BoolArray
    seconds: float


def published_chamfer(first: FloatArray, second: FloatArray) -> float:
    """The mean squared distance to the nearest, the mean of both ways, of clouds (n, 3) that are each brought into the
    unit sphere around the middle of its box: as the published code measures."""
    return chamfer_distance(_in_sphere(first), _in_sphere(second)) / 2.0


def held_out(
    model: TrainedRecovery, count: int, rng: np.random.Generator
) -> Iterator[tuple[str, list[RandomShape], list[Input]]]:
    """`count` shapes that no model has learnt from, as clouds, or as drawings from each view by itself."""
    shapes = list(islice(random_shapes(model.program, TEST, rng), count))
    names = [f"{number:03}" for number in range(count)]
    if model.entry.input == "points":
        clouds = [sampled_points(each.parts, GIVEN, rng) for each in shapes]
        yield "points", shapes, [Input(name, points=each) for name, each in zip(names, clouds, strict=True)]
        return
    for view in model.sketches.views:
        inks = [drawn(model.program, each.parts, view, model.sketches, rng) for each in shapes]
        angle = "trained" if not model.entry.views or view.name in model.entry.views else "novel"
        inputs = [Input(name, ink=each) for name, each in zip(names, inks, strict=True)]
        yield f"sketch, {angle} angle ({view.name})", shapes, inputs


def usable_models(folder: Path) -> Models:
    """The recovery models in a folder of published models. Raises ConfigError where none can be used."""
    models, wrong = find_models(folder)
    if not models:
        raise ConfigError(f"{wrong[0]}; make train")
    return models


def methods(model: TrainedRecovery, budget: int, seed: int) -> dict[str, Method]:
    """The ways from an upright input to values, by name."""
    program, kind = model.program, model.entry.input
    key = (model.header["program"], kind)

    def recovered(models: Models, shapes: int) -> Method:
        return lambda given: recover_input(given, key[0], models, "y", shapes, seed, turned=False).values

    found = {
        "base shape": lambda _: program.schema.base,
        "base shape, refined": recovered({}, budget),
        "network": recovered({key: model}, 1),
        "network, refined": recovered({key: model}, budget),
    }
    if kind == "points":
        found["nearest training shape"] = _nearest(program, np.random.default_rng(seed))
    return found


def tried(
    label: str, program: Program, method: Method, shapes: Sequence[RandomShape], inputs: Sequence[Input]
) -> Found:
    """What a method makes of inputs, against the shapes that they are of."""
    counts = np.array([len(each.values) for each in program.parameters])
    distances, classes = [], []
    seconds = 0.0
    for shape, given in zip(shapes, inputs, strict=True):
        began = time.perf_counter()
        values = method(given)
        seconds += time.perf_counter() - began
        clouds = [
            sampled_points(parts, MEASURED, np.random.default_rng(side))
            for side, parts in enumerate((shape.parts, program.parts(values)))
        ]
        distances.append(published_chamfer(*clouds))
        classes.append(program.schema.classes(values))
    found, truth = np.array(classes), np.array([each.classes for each in shapes])
    near = (np.abs(found - truth) <= 1) & (found < counts)
    return Found(label, program, np.array(distances), found == truth, near, truth < counts, seconds / len(inputs))


def floor(program: Program, shapes: Sequence[RandomShape]) -> FloatArray:
    """How far true shapes are from themselves, by chance, float64 (n,)."""
    pairs = ([sampled_points(each.parts, MEASURED, np.random.default_rng(side)) for side in (0, 1)] for each in shapes)
    return np.array([published_chamfer(*pair) for pair in pairs])


def recovery_table(found: Sequence[Found], floors: Mapping[str, float], budget: int) -> Table:
    """One row a method and kind of input; methods of one kind of input stand together, the network's first guess among
    them."""
    rows: list[tuple[Cell, ...]] = []
    programs = {each.program.name for each in found}
    first = {each.label.partition(": ")[0]: each for each in found if each.label.endswith(": network")}
    for each in found:
        guess = first[each.label.partition(": ")[0]]
        rows.append(
            (
                each.label,
                float(each.distances.mean()),
                float(np.median(each.distances)),
                100.0 * float(each.exact[each.visible].mean()),
                100.0 * float(each.near[each.visible].mean()),
                "" if each is guess else _significance(each.distances, guess.distances),
                each.seconds,
            )
        )
    rows += [(name, value) + ("",) * 5 for name, value in floors.items()]
    return Table(
        f"Shapes recovered from shapes that were not learnt from, {len(found[0].distances)} of each kind",
        ("input", "chamfer", "median", "exact %", "near %", "p", "seconds"),
        tuple(rows),
        notes=(
            f"chamfer: mean squared distance to the nearest of {MEASURED:,} points, the mean of both ways, each shape "
            "in the unit sphere around the middle of its box, as the published code measures. exact, near: of the "
            "parameters that are seen in the true shape, those that are right, and those within one class. p: of a "
            "paired t-test against the network's first guess. Refined: a search with "
            f"{budget} shapes at most. True shape: what is left where two samples of one shape are compared.",
            "Published figures are of the published programs, shapes and drawings; ours of ours. The published sets "
            "out of the distribution (AmateurSketch, ProSketch, ScanNet, ShapeNet) are not to be had here.",
        ),
        published=[each for each in PUBLISHED if each.name.partition(",")[0].replace(" ", "_") in programs],
    )


def accuracy_chart(found: Sequence[Found]) -> bytes:
    """A bar a parameter, as PNG: the share that is right where it is seen, dark, and that within one class, light; a
    panel for each of `found`, which are of one program."""
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
        panel.set(title=each.label, xlabel="% right, and within one class", xlim=(0, 100))
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_yticks(places, names, fontsize=6)
    panels[0].invert_yaxis()
    stream = io.BytesIO()
    figure.savefig(stream, metadata={"Software": None})
    return stream.getvalue()


def _nearest(program: Program, rng: np.random.Generator) -> Method:
    """The values of that of some training shapes whose points are nearest."""
    known = [
        (each.values, frame_of(points).normalized(points))
        for each in islice(random_shapes(program, TRAIN, rng), NEIGHBORS)
        for points in (shape_points(each.parts, GLIMPSE),)
    ]

    def method(given: Input) -> Values:
        assert given.points is not None
        points = frame_of(given.points).normalized(given.points[:GLIMPSE])
        return min(known, key=lambda each: chamfer_distance(points, each[1]))[0]

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
