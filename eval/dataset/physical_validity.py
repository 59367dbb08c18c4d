"""The table of physical validity: does what a dataset holds stand, and what of it does not?"""

from __future__ import annotations

import math
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
"""Shapes of ShapeAssembly programs, real ones and those that its model generates."""

PUSH = 0.1
"""A push in weights, and so the tangent of a tilt: with it the shares of real shape programs are nearest to those that
simulations find."""

NOTES = (
    "Stable: connected parts are one rigid body that stands and bears a push of each part sideways and a twist. "
    "Dropped: it is rooted, and after it has been let go and tilted as by a tenth of its weight its components rest as "
    "high as before, within 2.5 %, which is what the simulations of shapeassembly ask. "
    "Dry stable: as stable, with parts that only press and rub on each other where they touch. "
    "Margin: median push, in weights, that rigid shapes bear (-1: does not stand). Tipping: median angle. "
    "Pieces and floating parts: mean numbers. Overlap: volume in two parts; ground: area stood on, of the outline from "
    "above; mirror: weight that an upright mirror maps to its like; means.",
)


def judge_all(shapes: Sequence[Shape], config: PhysicsConfig) -> list[Validity]:
    """The validity of each shape; shapes of one kit share what is found out about its parts."""
    judges: dict[str, Judge] = {}
    found = []
    for shape in shared_meshes(shapes):
        if shape.up not in judges:
            judges[shape.up] = Judge(shape.meshes, shape.up, config)
        found.append(judges[shape.up].validity(shape.assembly))
    return found


def stays_up(shapes: Sequence[Shape], config: PhysicsConfig) -> list[bool]:
    """Which shapes are rooted and rest as high as they were let go after a push of PUSH (shapeassembly App. E)."""
    least = math.degrees(math.atan(PUSH))
    return [Judge(shape.meshes, shape.up, config).tilt_to_fall(shape.assembly) > least for shape in shapes]


@dataclass(frozen=True)
class Judged:
    """Shapes of one name, each with its validity as a rigid body."""

    shapes: Sequence[Shape]
    rigid: Sequence[Validity]


def judged_by_name(named: Iterable[tuple[str, Shape]], config: PhysicsConfig) -> dict[str, Judged]:
    """The shapes by their names, in order, judged as rigid bodies whatever `config.joints` says."""
    groups: dict[str, list[Shape]] = {}
    for name, shape in named:
        groups.setdefault(name, []).append(shape)
    rigid = config.model_copy(update={"joints": "rigid"})
    return {name: Judged(shapes, judge_all(shapes, rigid)) for name, shapes in groups.items()}


def physical_table(
    judged: Mapping[str, Judged], config: PhysicsConfig, most_dry: int, published: Sequence[ReferenceRow] = ()
) -> Table:
    """One row for each name. As dry blocks, which takes long, at most `most_dry` shapes of a name are judged, evenly
    spread."""
    rows = tuple(_row(name, each, config, most_dry) for name, each in judged.items())
    return Table("Physical validity", COLUMNS, rows, NOTES, published)


def _row(name: str, judged: Judged, config: PhysicsConfig, most_dry: int) -> tuple[Cell, ...]:
    shapes, rigid = judged.shapes, judged.rigid
    tried = shapes[:: -(-len(shapes) // max(most_dry, 1))][:most_dry]
    dry = judge_all(tried, config.model_copy(update={"joints": "dry"}))
    return (
        name,
        len(shapes),
        fmean(len(shape) for shape in shapes),
        100 * fmean(each.rooted for each in rigid),
        100 * fmean(each.stable for each in rigid),
        100 * fmean(stays_up(shapes, config)),
        100 * fmean(each.stable for each in dry) if dry else "",
        median(each.margin for each in rigid),
        median(each.tipping_degrees for each in rigid),
        fmean(each.components for each in rigid),
        fmean(each.floating for each in rigid),
        100 * fmean(each.penetration for each in rigid),
        100 * fmean(each.ground for each in rigid),
        100 * fmean(each.symmetry for each in rigid),
    )
