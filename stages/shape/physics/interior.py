"""A solver for the linear programmes of large assemblies: a primal-dual interior point method on a banded matrix.

HiGHS takes minutes for the ten programmes of a vault of 200 blocks. Every column acts on at most two bodies, so the
matrix of the normal equations has a block of 6 x 6 for each pair that touches. With bodies ordered along the structure
it is a band, which LAPACK factors in milliseconds on one thread. Several threads on a busy machine take a hundred times
as long (see pipeline.workers).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import FloatArray

MAX_ITERATIONS = 100
MAX_RESIDUAL = 1e-5
"""Largest residual of any equation at the end; forces and loads should be of the order of 1."""
MAX_COST_GAP = 1e-4
"""Largest gap of the costs at the end."""
DIVERGED_GAP = 1e12
"""A gap beyond which the method has diverged."""
STEP_TO_BOUND = 0.995
"""Share of the way to the nearest bound that a step goes."""
DIAGONAL_SHIFT = 1e-11
"""Added to the diagonal, as a share of its mean, since bodies that touch at a point can turn about it."""
MAX_GRADIENT_STEPS = 100
"""Maximum number of conjugate gradient steps for one solution of the normal equations."""


def solve_interior(
    wrenches: FloatArray, bodies: np.ndarray, count: int, loads: FloatArray, bounds: FloatArray, costs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Minimise costs . f with forces x >= 0 and 0 <= f <= bounds such that all wrenches on each body sum to zero.

    wrenches: wrench of a unit of each force on its two bodies, float64 (c, 2, 6)
    bodies: int64 (c, 2), the second -1 for none
    count: number of bodies n
    loads: wrench of a unit of each factor f on all bodies, float64 (k, 6 n)
    bounds, costs: float64 (k,)

    Returns the factors float64 (k,) and the dual solution float64 (6 n,). Raises ArithmeticError if the method does not
    converge. Mehrotra's predictor and corrector; the few loads are dense columns.
    """
    order, width = _along(bodies, count)
    rows = (6 * order[:, None] + np.arange(6)).ravel()
    dense = np.empty((6 * count, len(loads)))
    dense[rows] = loads.T
    system = _System(wrenches, np.where(bodies >= 0, order[bodies], -1), count, width, dense)
    now = _Point.first(len(wrenches), bounds, 6 * count)
    for _ in range(MAX_ITERATIONS):
        left = system.residuals(now, costs)
        gap = now.gap()
        if gap < MAX_COST_GAP and max(np.abs(residual).max() for residual in left) < MAX_RESIDUAL:
            return now.f, now.y[rows]
        if not gap < DIVERGED_GAP:
            break
        system.factor(now)
        straight = system.move(now, left, 0.0, None)
        primal, dual = now.reach(straight)
        after = now.after(straight, min(primal, 1.0), min(dual, 1.0)).gap()
        # No nearer to the bounds than needed: there the normal equations lose precision.
        aim = max((after / gap) ** 3 * gap, MAX_COST_GAP / 10) / (len(now.x) + 2 * len(now.f))
        bent = system.move(now, left, aim, straight)
        primal, dual = now.reach(bent)
        now = now.after(bent, min(STEP_TO_BOUND * primal, 1.0), min(STEP_TO_BOUND * dual, 1.0))
    raise ArithmeticError(f"the programme of equilibrium did not converge: the gap is {gap:.1e}")


@dataclass(frozen=True)
class _Point:
    """An iterate; a move has the same fields.

    x, z: forces and their slack
    f, s: factors and what is left of their bounds
    zf, zs: slack of f and of s
    y: dual values
    """

    x: FloatArray
    z: FloatArray
    f: FloatArray
    s: FloatArray
    zf: FloatArray
    zs: FloatArray
    y: FloatArray

    @classmethod
    def first(cls, forces: int, bounds: FloatArray, rows: int) -> _Point:
        """Return the first iterate.

        The forces share the weight of the bodies: ten thousands of forces of the order of 1 are too far from
        equilibrium to converge.
        """
        ones = np.ones(len(bounds))
        x = np.full(forces, min(rows / (6 * forces), 1.0))
        return cls(x, np.ones(forces), bounds / 2, bounds / 2, ones, ones, np.zeros(rows))

    def gap(self) -> float:
        return float(self.x @ self.z + self.f @ self.zf + self.s @ self.zs)

    def reach(self, move: _Point) -> tuple[float, float]:
        """Return the longest steps of the primal and of the dual values that keep them all positive."""
        primal = (self.x, move.x), (self.f, move.f), (self.s, move.s)
        dual = (self.z, move.z), (self.zf, move.zf), (self.zs, move.zs)
        return _longest(*primal), _longest(*dual)

    def after(self, move: _Point, primal: float, dual: float) -> _Point:
        return _Point(
            x=self.x + primal * move.x,
            z=self.z + dual * move.z,
            f=self.f + primal * move.f,
            s=self.s + primal * move.s,
            zf=self.zf + dual * move.zf,
            zs=self.zs + dual * move.zs,
            y=self.y + dual * move.y,
        )


class _System:
    """The equations of equilibrium, bodies in the order of the band, and Newton steps on them."""

    def __init__(self, wrenches: FloatArray, place: np.ndarray, count: int, width: int, dense: FloatArray) -> None:
        self._wrenches, self._place, self._count, self._width, self._dense = wrenches, place, count, width, dense

    def residuals(self, now: _Point, costs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the residuals of equilibrium, and of the dual equations of forces and of factors."""
        return -self._act(now.x, now.f), -self._lift(now.y) - now.z, costs - self._dense.T @ now.y - now.zf + now.zs

    def factor(self, now: _Point) -> None:
        """Factor the normal equations; loads enter by the Sherman-Morrison-Woodbury formula."""
        from scipy.linalg import cho_solve_banded, cholesky_banded

        self._weight_x, self._weight_f = now.x / now.z, 1 / (now.zf / now.f + now.zs / now.s)
        band = _normal(self._wrenches, self._place, self._weight_x, self._count, self._width)
        band[0] += DIAGONAL_SHIFT * band[0].mean()
        self._band = cholesky_banded(band, lower=True, check_finite=False), True
        self._spread = cho_solve_banded(self._band, self._dense, check_finite=False)
        self._small = np.diag(1 / self._weight_f) + self._dense.T @ self._spread

    def move(
        self, now: _Point, left: tuple[FloatArray, FloatArray, FloatArray], aim: float, bend: _Point | None
    ) -> _Point:
        """Return the Newton step to where each value times its slack is `aim`, minus what `bend` adds to that."""
        primal, dual_x, dual_f = left
        want_x, want_f, want_s = aim - now.x * now.z, aim - now.f * now.zf, aim - now.s * now.zs
        if bend is not None:
            want_x, want_f, want_s = want_x - bend.x * bend.z, want_f - bend.f * bend.zf, want_s - bend.s * bend.zs
        grad_x = dual_x - want_x / now.x
        grad_f = dual_f - want_f / now.f + want_s / now.s
        dy = self._solve(primal + self._act(self._weight_x * grad_x, self._weight_f * grad_f))
        dx = self._weight_x * (self._lift(dy) - grad_x)
        df = self._weight_f * (self._dense.T @ dy - grad_f)
        return _Point(
            x=dx,
            z=(want_x - now.z * dx) / now.x,
            f=df,
            s=-df,
            zf=(want_f - now.zf * df) / now.f,
            zs=(want_s + now.zs * df) / now.s,
            y=dy,
        )

    def _act(self, x: FloatArray, f: FloatArray) -> FloatArray:
        acting: FloatArray = _act(self._wrenches, self._place, x, self._count) + self._dense @ f
        return acting

    def _lift(self, y: FloatArray) -> FloatArray:
        lifted: FloatArray = _lift(self._wrenches, self._place, y)
        return lifted

    def _solve(self, right: FloatArray) -> FloatArray:
        """Solve the normal equations by conjugate gradients, preconditioned by the factors.

        If bodies can turn about a point, the shifted factors are so much too stiff that iterative refinement would not
        converge.
        """
        answer, left = np.zeros_like(right), right
        along, before = np.zeros_like(right), 1.0
        for _ in range(MAX_GRADIENT_STEPS):
            if np.abs(left).max() <= MAX_RESIDUAL * 1e-4:
                break
            near = self._nearly(left)
            worth = float(left @ near)
            if not worth > 0:  # only rounding is left
                break
            along = near + worth / before * along
            acting = _act_on_lifted(self._wrenches, self._place, self._weight_x, along, self._count)
            acting += self._dense @ (self._weight_f * (self._dense.T @ along))
            step = worth / float(along @ acting)
            answer, left, before = answer + step * along, left - step * acting, worth
        return answer

    def _nearly(self, right: FloatArray) -> FloatArray:
        """Return the answer of the factors alone."""
        from scipy.linalg import cho_solve_banded

        plain = cho_solve_banded(self._band, right, check_finite=False)
        near: FloatArray = plain - self._spread @ np.linalg.solve(self._small, self._dense.T @ plain)
        return near


def _longest(*moves: tuple[FloatArray, FloatArray]) -> float:
    """Return the longest step, at most a long one, that keeps all values positive."""
    longest = 1e3
    for value, move in moves:
        falling = move < 0
        if falling.any():
            longest = min(longest, float((value[falling] / -move[falling]).min()))
    return longest


def _along(bodies: np.ndarray, count: int) -> tuple[np.ndarray, int]:
    """Return the index of each body in an order in which touching bodies are near, and the number of lower diagonals.

    The order is reverse Cuthill-McKee. The diagonals are those of the matrix of 6 x 6 blocks.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    both = bodies[bodies[:, 1] >= 0]
    graph = coo_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()
    index = np.argsort(reverse_cuthill_mckee(graph + graph.T, symmetric_mode=True))
    distance = np.abs(index[both[:, 0]] - index[both[:, 1]]).max(initial=0)
    return index, 6 * int(distance) + 5


@numba.njit(cache=True)
def _normal(wrenches, order, weights, count, width):
    """Return the lower band, (width + 1, 6 count), of the weighted sum of the columns' outer products."""
    band = np.zeros((width + 1, 6 * count))
    for c in range(len(wrenches)):
        for side in range(2):
            p = order[c, side]
            if p < 0:
                continue
            for other in range(2):
                q = order[c, other]
                if q < 0 or q > p:
                    continue
                for i in range(6):
                    scaled = weights[c] * wrenches[c, side, i]
                    for j in range(6):
                        row, column = 6 * p + i, 6 * q + j
                        if row >= column:
                            band[row - column, column] += scaled * wrenches[c, other, j]
    return band


@numba.njit(cache=True)
def _act(wrenches, order, x, count):
    out = np.zeros(6 * count)
    for c in range(len(wrenches)):
        for side in range(2):
            p = order[c, side]
            if p >= 0:
                for i in range(6):
                    out[6 * p + i] += x[c] * wrenches[c, side, i]
    return out


@numba.njit(cache=True)
def _lift(wrenches, order, y):
    out = np.zeros(len(wrenches))
    for c in range(len(wrenches)):
        for side in range(2):
            p = order[c, side]
            if p >= 0:
                for i in range(6):
                    out[c] += y[6 * p + i] * wrenches[c, side, i]
    return out


@numba.njit(cache=True)
def _act_on_lifted(wrenches, order, weights, y, count):
    """Return `_act` of the weighted `_lift` of `y`: reading the wrenches, which takes most of the time, only once."""
    out = np.zeros(6 * count)
    for c in range(len(wrenches)):
        lifted = 0.0
        for side in range(2):
            p = order[c, side]
            if p >= 0:
                for i in range(6):
                    lifted += y[6 * p + i] * wrenches[c, side, i]
        lifted *= weights[c]
        for side in range(2):
            p = order[c, side]
            if p >= 0:
                for i in range(6):
                    out[6 * p + i] += lifted * wrenches[c, side, i]
    return out
