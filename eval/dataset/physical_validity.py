"""Physical validity of shapes: rooted, stable, and how large a push they bear."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from eval.engine.shapes import shared_meshes
from eval.engine.table import Cell, ReferenceRow, Table
from stages.shape.physics.judge import Judge, Validity
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape

COLUMNS = (
    "shapes of",
    "shapes",
    "parts",
    "rooted %",
    "stable %",
    "dropped %",
    "dry stable %",
    "margin",
    "tipping °",
    "pieces",
    "floating",
    "overlap %",
    "ground %",
    "mirror %",
)

SOURCE = "shapeassembly Table 2, by simulation"

PUBLISHED = tuple(
    ReferenceRow(f"{category}, {of}", SOURCE, {"rooted %": rooted, "dropped %": stable})
    for category, of, rooted, stable in (
        ("chair", "ground truth", 100.0, 88.0),
        ("table", "ground truth", 100.0, 93.1),
        ("storage", "ground truth", 100.0, 87.0),
        ("chair", "generated", 94.5, 84.7),
        ("table", "generated", 96.2, 85.9),
        ("storage", "generated", 95.3, 83.7),
    )
)
"""Shapes of ShapeAssembly programs: real ones, and ones that its model generates."""

NOTES = (
    "Stable: connected parts are one rigid body that bears a sideways push of each part and a twist. "
    "Dropped: the shape is rooted, and its components keep their height, within 2.5 %, after a tilt that amounts to a "
    "push of a tenth of its weight, as in the simulations of shapeassembly. "
    "Dry stable: as stable, but parts only press and rub on each other where they touch. "
    "Margin: median push, in weights, that rigid shapes bear; -1 for a shape that falls. Tipping: median angle. "
    "Pieces and floating parts: mean numbers. Overlap: volume shared by two parts. Ground: support area as a share of "
    "the outline from above. Mirror: weight that an upright mirror maps onto an equal part. All three are means.",
)


def judge_all(shapes: Sequence[Shape], config: PhysicsConfig) -> list[Validity]:
    """Judge each shape; shapes of one kit share what is computed for its parts."""
    judges: dict[str, Judge] = {}
    results = []
    for shape in shared_meshes(shapes):
        if shape.up not in judges:
            judges[shape.up] = Judge(shape.meshes, shape.up, config)
        results.append(judges[shape.up].validity(shape.assembly))
    return results


def stays_up(shapes: Sequence[Shape], config: PhysicsConfig) -> list[bool]:
    """Return which shapes are rooted and keep their height after a push of FALL_PUSH (shapeassembly App. E)."""
    return [not Judge(shape.meshes, shape.up, config).fall(shape.assembly).falls for shape in shapes]


@dataclass(frozen=True)
class PhysicalResults:
    """Shapes of one name, each with its validity as one rigid body."""

    shapes: Sequence[Shape]
    rigid: Sequence[Validity]


def judge_by_name(named: Iterable[tuple[str, Shape]], config: PhysicsConfig) -> dict[str, PhysicalResults]:
    """Judge shapes as rigid bodies, whatever `config.joints` is, and group them by name."""
    groups: dict[str, list[Shape]] = {}
    for name, shape in named:
        groups.setdefault(name, []).append(shape)
    rigid = config.model_copy(update={"joints": "rigid"})
    return {name: PhysicalResults(shapes, judge_all(shapes, rigid)) for name, shapes in groups.items()}


def physical_table(
    results: Mapping[str, PhysicalResults],
    config: PhysicsConfig,
    dry_shapes: int,
    published: Sequence[ReferenceRow] = (),
) -> Table:
    """Return one row for each name. At most `dry_shapes` of its shapes, evenly spread, are judged as dry blocks."""
    rows = tuple(_row(name, result, config, dry_shapes) for name, result in results.items())
    return Table("Physical validity", COLUMNS, rows, NOTES, published)


def _row(name: str, result: PhysicalResults, config: PhysicsConfig, dry_shapes: int) -> tuple[Cell, ...]:
    shapes, rigid = result.shapes, result.rigid
    subset = shapes[:: -(-len(shapes) // max(dry_shapes, 1))][:dry_shapes]
    dry = judge_all(subset, config.model_copy(update={"joints": "dry"}))
    return (
        name,
        len(shapes),
        fmean(len(shape) for shape in shapes),
        100 * fmean(validity.rooted for validity in rigid),
        100 * fmean(validity.stable for validity in rigid),
        100 * fmean(stays_up(shapes, config)),
        100 * fmean(validity.stable for validity in dry) if dry else "",
        median(validity.margin for validity in rigid),
        median(validity.tipping_degrees for validity in rigid),
        fmean(validity.components for validity in rigid),
        fmean(validity.floating for validity in rigid),
        100 * fmean(validity.penetration for validity in rigid),
        100 * fmean(validity.ground for validity in rigid),
        100 * fmean(validity.symmetry for validity in rigid),
    )
