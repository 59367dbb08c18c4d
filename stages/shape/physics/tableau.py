"""Linear programmes of one rigid body: six equations, solved by the simplex method on a dense tableau.

Ten of them take a millisecond; a general solver takes tens of milliseconds.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray

FEASIBILITY_TOLERANCE = 1e-7
"""Largest residual of an equation that holds."""
TIE_TOLERANCE = 1e-6
"""Of loads that grow equally far the first decides what gives way."""
ZERO_RATE = 1e-9
"""Smaller rates are rounding and are never divided by."""
GREEDY_PIVOTS = 100
"""Pivots by the greatest gain; later ones take the first, which never cycles (Bland's rule)."""
MAX_PIVOTS = 2_000
NO_END = -2.0


def grow_loads(edges: FloatArray, load: FloatArray, growing: FloatArray, cap: float) -> tuple[FloatArray, FloatArray]:
    """Return the greatest factor, at most `cap`, of each load with edges @ x + factor * growing = load for some x >= 0.

    edges: wrench of a unit of each force, float64 (rows, c)
    load: float64 (rows,)
    growing: float64 (loads, rows)

    Returns the factors, float64 (loads,), all -1 if there is no x even for factor 0, and the multipliers of the
    equations, float64 (loads, rows), 0 if the cap was reached. For the first of the loads that grow least the shortest
    multipliers are taken, which do not depend on the orientation of the equations.

    Raises ArithmeticError if the method finds no end, or its answer does not solve the equations.
    """
    rows, count = edges.shape
    sign = np.where(load < 0, -1.0, 1.0)
    # columns: the forces, a slack for each equation (the inverse of the basis stands there), the factor, the values
    table = np.zeros((rows, count + rows + 2))
    table[:, :count] = edges * sign[:, None]
    table[:, count : count + rows] = np.eye(rows)
    table[:, -1] = load * sign
    basis = count + np.arange(rows)
    left = _empty_slacks(table, basis, count)
    if left == NO_END:
        raise ArithmeticError("no end to the search for an equilibrium")
    if left > FEASIBILITY_TOLERANCE:
        return np.full(len(growing), -1.0), np.zeros_like(growing)
    table[basis >= count, -1] = 0.0
    factors, multipliers = np.empty(len(growing)), np.zeros_like(growing)
    for index, load_row in enumerate(growing):
        grown, final = table.copy(), basis.copy()
        grown[:, -2] = grown[:, count : count + rows] @ (load_row * sign)
        reached = _grow(grown, final, count, cap)
        own = final < count
        row = np.flatnonzero(final == count + rows)
        factor = float(grown[row[0], -1]) if len(row) else 0.0
        borne = edges[:, final[own]] @ grown[own, -1] + factor * load_row
        if (
            reached == NO_END
            or np.abs(borne - load).max() > 10 * FEASIBILITY_TOLERANCE
            or grown[own, -1].min(initial=0) < -FEASIBILITY_TOLERANCE
        ):
            raise ArithmeticError("no end to the growth of a load")
        factors[index] = reached
        if reached < cap:
            multipliers[index] = grown[row[0], count : count + rows] * sign
    worst = int(np.flatnonzero(factors <= factors.min() + TIE_TOLERANCE)[0])
    if factors[worst] < cap:
        multipliers[worst] = _least(edges, load, growing[worst], factors[worst], multipliers[worst])
    return factors, multipliers


def _least(edges: FloatArray, load: FloatArray, growing: FloatArray, factor: float, found: FloatArray) -> FloatArray:
    """Return the shortest multipliers y with edges.T @ y >= 0, growing @ y >= 1, load @ y <= factor.

    Least distance programming (Lawson and Hanson 1974, chapter 23). Returns `found` if it fails.
    """
    from scipy.optimize import nnls

    inner = np.vstack([edges.T, growing, -load])
    bounds = np.concatenate([np.zeros(edges.shape[1]), [1.0, -factor - FEASIBILITY_TOLERANCE]])
    try:
        forces, _ = nnls(np.vstack([inner.T, bounds]), np.concatenate([np.zeros(len(load)), [1.0]]))
    except RuntimeError:
        return found
    gap = 1.0 - bounds @ forces
    least: FloatArray = inner.T @ forces / gap if gap > 0 else found
    return least if (inner @ least >= bounds - 10 * FEASIBILITY_TOLERANCE).all() else found


@numba.njit(cache=True)
def _pivot(table, basis, row, column):
    """Let the variable `column` enter the basis at `row`."""
    table[row] /= table[row, column]
    for other in range(len(table)):
        if other != row and table[other, column] != 0.0:
            table[other] -= table[other, column] * table[row]
    basis[row] = column


@numba.njit(cache=True)
def _leaving(table, basis, count, column, fixed):
    """Return the row whose variable first becomes zero as that of `column` grows, -1 for none.

    Ties go to the first variable. `fixed`: whether slacks are zero and must stay so.
    """
    leaving, least_ratio = -1, np.inf
    for row in range(len(table)):
        rate = table[row, column]
        slack = fixed and count <= basis[row] < count + len(table)
        if rate > ZERO_RATE or (slack and rate < -ZERO_RATE):
            ratio = 0.0 if slack else max(table[row, -1], 0.0) / rate
            if ratio < least_ratio - ZERO_RATE or (ratio <= least_ratio + ZERO_RATE and basis[row] < basis[leaving]):
                leaving, least_ratio = row, min(ratio, least_ratio)
    return leaving


@numba.njit(cache=True)
def _entering(rates, greedy):
    """Return the column of the greatest rate, or of the first above rounding, -1 for none."""
    entering, greatest_rate = -1, ZERO_RATE
    for column in range(len(rates)):
        if rates[column] > greatest_rate:
            entering, greatest_rate = column, rates[column]
            if not greedy:
                break
    return entering


@numba.njit(cache=True)
def _empty_slacks(table, basis, count):
    """Pivot until the slacks are minimal. Returns what is left of them."""
    for step in range(MAX_PIVOTS):
        rates = np.zeros(count)
        left = 0.0
        for row in range(len(table)):
            if basis[row] >= count:
                left += table[row, -1]
                rates += table[row, :count]
        column = _entering(rates, step < GREEDY_PIVOTS)
        if column < 0 or left <= 0.0:
            return left
        row = _leaving(table, basis, count, column, False)
        if row < 0:
            break
        _pivot(table, basis, row, column)
    return NO_END


@numba.njit(cache=True)
def _grow(table, basis, count, cap):
    """Pivot from a basis that bears the steady load until the factor is greatest. Returns the factor, or the cap."""
    factor = count + len(table)
    row = _leaving(table, basis, count, factor, True)
    if row < 0:
        return cap
    _pivot(table, basis, row, factor)
    for step in range(MAX_PIVOTS):
        if table[row, -1] >= cap:
            return cap
        column = _entering(-table[row, :count], step < GREEDY_PIVOTS)
        if column < 0:
            return max(table[row, -1], 0.0)
        leaving = _leaving(table, basis, count, column, True)
        if leaving < 0:
            return cap
        _pivot(table, basis, leaving, column)
    return NO_END
