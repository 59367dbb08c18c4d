"""The table of physical validity: does what a dataset holds stand, and what of it does not?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean, median

from eval.shapes import shared_meshes
from eval.table import Cell, Table
from stages.shape.physics.judge import Judge, Validity
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape

__all__ = ["FIRM", "PUBLISHED", "judge_all", "physical_table"]

COLUMNS = (
    "shapes of",
    "shapes",
    "parts",
    "rooted %",
    "stable %",
    "firm %",
    "dry stable %",
    "margin",
    "tipping °",
    "pieces",
    "floating",
    "overlap %",
    "ground %",
    "mirror %",
)

PUBLISHED: dict[str, tuple[float, float]] = {"chair": (100.0, 88.0), "table": (100.0, 93.1), "storage": (100.0, 87.0)}
"""Rooted and stable shares of the ground truth of shape programs, by simulation (shapeassembly Table 2)."""

FIRM = 0.1
"""A push in weights: with it the shares of real shape programs are nearest to those that simulations find."""

NOTES = (
    "Stable: connected parts are one rigid body that stands and bears a push of each part sideways and a twist. Firm: "
    "it bears a tenth of its weight so. Dry stable: as stable, with parts that only press and rub on each other where "
    "they touch. Margin: median push, in weights, that rigid shapes bear (-1: does not stand). Tipping: median angle. "
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


def physical_table(
    named: Iterable[tuple[str, Shape]], config: PhysicsConfig, dry: int, published: Sequence[str] = ()
) -> Table:
    """One row for each name among the shapes, in order, and one for each category of `published`.

    `config.joints` is tried both ways; dry ones, which take long, with at most `dry` shapes of a name, evenly spread.
    """
    groups: dict[str, list[Shape]] = {}
    for name, shape in named:
        groups.setdefault(name, []).append(shape)
    rows = [_row(name, shapes, config, dry) for name, shapes in groups.items()]
    for category in published:
        rooted, stable = PUBLISHED[category]
        rows.append((f"{category}, published", "", "", rooted, stable, *[""] * (len(COLUMNS) - 5)))
    return Table("Physical validity", COLUMNS, tuple(rows), NOTES)


def _row(name: str, shapes: list[Shape], config: PhysicsConfig, most_dry: int) -> tuple[Cell, ...]:
    tried = shapes[:: -(-len(shapes) // max(most_dry, 1))][:most_dry]
    rigid = judge_all(shapes, config.model_copy(update={"joints": "rigid"}))
    dry = judge_all(tried, config.model_copy(update={"joints": "dry"}))
    return (
        name,
        len(shapes),
        fmean(len(shape) for shape in shapes),
        100 * fmean(each.rooted for each in rigid),
        100 * fmean(each.stable for each in rigid),
        100 * fmean(each.margin >= FIRM for each in rigid),
        100 * fmean(each.stable for each in dry) if dry else "",
        median(each.margin for each in rigid),
        median(each.tipping_degrees for each in rigid),
        fmean(each.components for each in rigid),
        fmean(each.floating for each in rigid),
        100 * fmean(each.penetration for each in rigid),
        100 * fmean(each.ground for each in rigid),
        100 * fmean(each.symmetry for each in rigid),
    )
