"""Random shapes of an exemplar: some layouts with other rows, each in random proportions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.settings import ProportionsConfig
from stages.proportions.text import AXES, Proportions, ProportionShapes, Unwarped
from stages.proportions.warp import FACTOR_DECIMALS, Lattice, Warp
from stages.proportions.warp_check import warp_fault
from stages.rows.changes import Change
from stages.rows.draws import LayoutDraws
from stages.rows.settings import RowsConfig
from stages.rows.slabs import RowChange
from stages.rows.turns import Turn
from stages.shape.arrays import FloatArray
from stages.shape.physics.judge import unmet_requirement

TRIES_PER_LAYOUT = 4
"""Draws of layouts for each one that is wanted."""
MAX_LAYOUTS = 48
"""Layouts of one exemplar that one search resizes."""
MIN_OTHER_LAYOUTS = 8
"""Layouts with other rows from which the exemplar's own is left out."""
THIN_SHARE = 0.04
"""Lengths below this share of the longest side are the thickness of boards, which keep it as long as that is possible.
"""
PLAIN_SHARE = 0.25
"""Share of the shapes with other rows whose lengths are not multiplied at random."""
MIN_COMPRESSION = 0.25
"""Factor below which boards become thinner too."""


@dataclass(frozen=True)
class DrawnLayout:
    """A layout of an exemplar with the warps of it that were accepted.

    stiff: axes along which lengths stay although there are no changes: an exemplar whose spokes change stays round
    """

    changes: tuple[Change, ...]
    unwarped: Unwarped
    distinct: DistinctWarps
    stiff: frozenset[int] = frozenset()

    def is_new(self, warp: Warp) -> bool:
        """Return whether a warp differs enough from those accepted and, for the exemplar's own layout, from none."""
        if self.changes and not len(self.distinct):
            return True
        return self.distinct.is_new(warp)


def drawn_layouts(
    shapes: ProportionShapes,
    exemplar: str,
    config: ProportionsConfig,
    rows: RowsConfig | None,
    wanted: int,
    rng_of: Callable[[int], np.random.Generator],
    reject: Callable[[str, int], None],
) -> list[DrawnLayout]:
    """Return at most `wanted` layouts of an exemplar that hold together; its own alone without `rows`.

    rng_of: function that returns the random numbers of each draw
    reject: is told why layouts, or places of rows, are rejected, and their number
    """
    own = DrawnLayout((), shapes.unwarped(exemplar, ()), _distinct(shapes.unwarped(exemplar, ()), config))
    if rows is None:
        return [own]
    draws = LayoutDraws(shapes.layout(exemplar), rows, is_alone=True, up=AXES.index(shapes.kit.up))
    found: list[DrawnLayout] = []
    known = {draws.exemplar.key}
    for reason, count in sorted(draws.refused.items()):
        reject(f"row: {reason}", count)
    if not draws.can_change:
        return [own]
    wanted = min(wanted, MAX_LAYOUTS)
    for number in range(TRIES_PER_LAYOUT * wanted):
        if len(found) == wanted:
            break
        drawn = draws.draw(rng_of(number))
        if drawn is None or drawn[1].key in known:
            continue
        changes, layout = drawn
        known.add(layout.key)
        if layout.pieces().max() > draws.exemplar.pieces().max():
            reject("row: in more pieces than the exemplar", 1)
            continue
        unwarped = shapes.unwarped_layout(layout)
        fault = warp_fault(shapes.kit, unwarped.assembly, unwarped.shape)
        fault = fault or unmet_requirement(config.require, unwarped.shape)
        if fault is not None:
            reject(f"row: {fault}", 1)
            continue
        found.append(DrawnLayout(changes, unwarped, _distinct(unwarped, config)))
    if len(found) >= MIN_OTHER_LAYOUTS:
        return found
    turns = [change for layout in found for change in layout.changes if isinstance(change, Turn)]
    return [replace(own, stiff=frozenset(_stiff_axes(turns))), *found]


def _distinct(unwarped: Unwarped, config: ProportionsConfig) -> DistinctWarps:
    return DistinctWarps(unwarped.lattice, config.min_difference)


def draw_proportions(
    exemplar: str,
    layout: DrawnLayout,
    sides: FloatArray,
    rng: np.random.Generator,
    config: ProportionsConfig,
    rows: RowsConfig,
) -> Proportions:
    """Return random proportions of a layout. sides: those of the box around the exemplar, float64 (3,)."""
    lattice = layout.unwarped.lattice
    warp = lattice.draw(rng, config.log_std, config.max_factor)
    if not layout.changes:
        x, y, z = (np.ones(len(factors)) if axis in layout.stiff else factors for axis, factors in enumerate(warp))
        return Proportions(exemplar, (x, y, z))
    stiff = _stiff_axes(layout.changes) if rows.size == "keep" and rng.random() >= PLAIN_SHARE else {0, 1, 2}
    x, y, z = (np.ones(len(factors)) if axis in stiff else factors for axis, factors in enumerate(warp))
    warp = x, y, z
    if rows.size == "keep":
        warp = within_range(lattice, warp, sides, rows.size_range, _stiff_axes(layout.changes))
    return Proportions(exemplar, warp, layout.changes)


def _stiff_axes(changes: Sequence[Change]) -> set[int]:
    """Return axes along which lengths stay: those of slanted rows, and across those that rows are about."""
    stiff: set[int] = set()
    for change in changes:
        if isinstance(change, Turn):
            stiff |= {0, 1, 2} - {change.axis}
        elif isinstance(change, RowChange) and np.count_nonzero(change.shift) > 1:
            stiff |= set(np.flatnonzero(change.shift).tolist())
    return stiff


def within_range(
    lattice: Lattice, warp: Warp, sides: FloatArray, limits: tuple[float, float], stiff: Collection[int] = ()
) -> Warp:
    """Return a warp changed so that each side of the box around a shape is within a range of multiples of `sides`.

    stiff: axes that keep their factors
    """
    fitted = []
    longest = max(float(knots[-1] - knots[0]) for knots in lattice.knots)
    for axis, (knots, factors, side) in enumerate(zip(lattice.knots, warp, sides.tolist(), strict=True)):
        lengths = np.diff(knots) * factors
        length = float(lengths.sum())
        wanted = min(max(length, limits[0] * side), limits[1] * side)
        if axis in stiff or not len(lengths) or length <= 0 or np.isclose(wanted, length):
            fitted.append(factors)
            continue
        scaled = lengths > THIN_SHARE * longest
        rest = float(lengths[~scaled].sum())
        factor = (wanted - rest) / max(float(lengths[scaled].sum()), 1e-12)
        changed = np.where(scaled, factor, 1.0) if factor >= MIN_COMPRESSION else np.full(len(lengths), wanted / length)
        fitted.append(np.maximum(np.round(factors * changed, FACTOR_DECIMALS), 10.0**-FACTOR_DECIMALS))
    x, y, z = fitted
    return x, y, z
