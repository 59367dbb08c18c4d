"""Equilibrium of rigid bodies that press and rub on each other, as linear programmes.

Each contact point bears any force in its friction cone, replaced by an inscribed pyramid. So a shape found stable is
stable with the round cone too. Between the directions of the pyramid friction is up to 8 % too weak in joints, where it
is exact along the slope and across it, and up to 1 % on the ground. A glued joint bears pull up to a limit: then the
cone begins that far behind. Bodies are rigid and joints do not crush. This is limit analysis: a shape fails by a
mechanism of rigid bodies, given by the dual solution. Joints do not open as they slide (no dilatancy), so limit
analysis may call a shape stable that could slide. A simulation moves bodies and so sees shapes settle elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.physics.contacts import ContactPatches

JOINT_DIRECTIONS = 8
"""Sides of the friction pyramid of a joint."""
GROUND_DIRECTIONS = 24
"""Sides of the friction pyramid on the ground, where slopes do not give the direction of sliding."""
MAX_HIGHS_COLUMNS = 4_000
"""Programmes with up to this many columns in total are solved by HiGHS."""
MAX_HIGHS_ITERATIONS = 20_000
MIN_WEIGHT_SHARE = 1e-8
"""Lighter bodies count as this share of the heaviest in the scaling of equations."""
STEADY_LOAD_WEIGHT = 100.0
"""Cost of the steady load relative to that of a growing one."""
BORNE_TOLERANCE = 1e-5
"""A load is borne if at most this share of it is left over."""


@dataclass(frozen=True)
class LoadLimits:
    """How far loads can grow.

    factors: greatest factor up to the cap with equilibrium, float64 (loads,); all -1 without equilibrium even at 0, or
        if no solver finds one
    motions: how each body begins to move when the load grows beyond that, displacement of its centre and turn, float64
        (loads, n, 6); 0 if the cap was reached
    """

    factors: FloatArray
    motions: FloatArray


def load_limits(
    patches: ContactPatches,
    centres: FloatArray,
    steady: FloatArray,
    growing: FloatArray,
    friction: float,
    pull: FloatArray,
    azimuth: float,
    cap: float = 1.0,
) -> LoadLimits:
    """Return the greatest factor, at most `cap`, by which each load of `growing` can be borne in addition to `steady`.

    centres: point of each body about which torques are counted, float64 (n, 3)
    steady: force and torque on each body, float64 (n, 6)
    growing: float64 (loads, n, 6)
    pull: pull that each contact point bears, float64 (q,)
    azimuth: origin of the friction directions on level ground, radians
    """
    ground = patches.second < 0
    parts = [
        _wrenches(patches.first[own], patches.second[own], patches.points[own], centres, forces)
        for own, forces in (
            (ground, _cone(patches.normals[ground], friction, azimuth, GROUND_DIRECTIONS)),
            (~ground, _cone(patches.normals[~ground], friction, azimuth, JOINT_DIRECTIONS)),
        )
    ]
    wrenches, bodies = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    # Equations in weights of each body and forces in weights of the lighter of two, so that solvers see light bodies.
    weights = np.linalg.norm(growing[:, :, :3], axis=2).max(axis=0)
    weights = np.maximum(weights, MIN_WEIGHT_SHARE * weights.max())
    wrenches = (
        wrenches
        / weights[bodies][:, :, None]
        * np.where(bodies < 0, np.inf, weights[bodies]).min(axis=1)[:, None, None]
    )
    load = -(steady + _glue(patches, centres, pull)) / weights[:, None]
    limits = _solved(wrenches, bodies, load, growing / weights[:, None], cap)
    return LoadLimits(limits.factors, limits.motions / weights[:, None])


def _solved(wrenches: FloatArray, bodies: np.ndarray, load: FloatArray, growing: FloatArray, cap: float) -> LoadLimits:
    """Solve one body by the simplex method, small programmes by HiGHS, and large ones by the interior point method.

    If a method fails, another takes over.
    """
    if len(load) == 1:
        limits = _by_tableau(wrenches, bodies, load, growing, cap)
        if limits is not None:
            return limits
    if len(wrenches) * len(growing) <= MAX_HIGHS_COLUMNS:
        limits = _by_highs(wrenches, bodies, load, growing, cap)
        if limits is not None:
            return limits
    factors, motions = np.full(len(growing), -1.0), np.zeros_like(growing)
    for index in range(len(growing)):
        single = wrenches, bodies, load, growing[index : index + 1], cap
        limits = _by_interior_point(*single) or _by_highs(*single)
        if limits is None or limits.factors[0] < 0:
            return LoadLimits(np.full(len(growing), -1.0), motions)
        factors[index], motions[index] = limits.factors[0], limits.motions[0]
    return LoadLimits(factors, motions)


def _by_tableau(
    wrenches: FloatArray, bodies: np.ndarray, load: FloatArray, growing: FloatArray, cap: float
) -> LoadLimits | None:
    """Solve all loads on one body, which only the ground bears. Returns None if the method fails."""
    from stages.shape.physics.tableau import grow_loads

    edges = np.where((bodies >= 0)[:, :, None], wrenches, 0.0).sum(axis=1).T
    try:
        factors, multipliers = grow_loads(edges, load[0], growing[:, 0], cap)
    except ArithmeticError:
        return None
    return LoadLimits(factors, multipliers[:, None])


def _by_highs(
    wrenches: FloatArray, bodies: np.ndarray, load: FloatArray, growing: FloatArray, cap: float
) -> LoadLimits | None:
    """Solve all loads as one programme of independent blocks. Returns None if HiGHS finds no answer.

    A call costs more than a small programme.
    """
    from scipy import sparse
    from scipy.optimize import linprog

    loads, count = growing.shape[:2]
    columns, rows = len(wrenches), 6 * count
    own = np.flatnonzero(bodies.ravel() >= 0)
    row = 6 * bodies.ravel()[own, None] + np.arange(6)
    column = np.broadcast_to((own // 2)[:, None], row.shape)
    values = wrenches.reshape(-1, 6)[own]
    matrix = sparse.csc_matrix((values.ravel(), (row.ravel(), column.ravel())), shape=(rows, columns))
    factor = sparse.block_diag([load.reshape(-1, 1) for load in growing], format="csc")
    system = sparse.hstack([sparse.kron(sparse.eye(loads), matrix, format="csc"), factor], format="csc")
    costs = np.concatenate([np.zeros(loads * columns), -np.ones(loads)])
    bounds = np.column_stack([np.zeros(len(costs)), np.full(len(costs), np.inf)])
    bounds[-loads:, 1] = cap
    solved = linprog(
        costs,
        A_eq=system,
        b_eq=np.tile(load.ravel(), loads),
        bounds=bounds,
        method="highs",
        options={"maxiter": MAX_HIGHS_ITERATIONS},
    )
    if solved.status == 2:  # no equilibrium at factor 0, which is the same for all
        return LoadLimits(np.full(loads, -1.0), np.zeros_like(growing))
    if solved.status != 0:
        return None
    return LoadLimits(solved.x[-loads:], -solved.eqlin.marginals.reshape(growing.shape))


def _by_interior_point(
    wrenches: FloatArray, bodies: np.ndarray, load: FloatArray, growing: FloatArray, cap: float
) -> LoadLimits | None:
    """Solve one load. Returns None if the method fails.

    The steady load has a factor of its own, at most 1, with a far greater cost than the growing one. So there is always
    a solution, and the steady load is borne if that factor is 1.
    """
    from stages.shape.physics.interior import solve_interior

    loads = np.stack([-load.ravel(), growing.ravel()])
    try:
        solution, dual = solve_interior(
            wrenches, bodies, len(load), loads, np.array([1.0, cap]), np.array([-STEADY_LOAD_WEIGHT, -1.0])
        )
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    borne = solution[0] >= 1 - BORNE_TOLERANCE
    return LoadLimits(np.array([solution[1] if borne else -1.0]), -dual.reshape(growing.shape))


def _cone(normals: FloatArray, friction: float, azimuth: float, directions: int) -> FloatArray:
    """Return the edges of the friction pyramid of each contact, float64 (q, directions, 3).

    The first direction is level and one perpendicular to it the steepest, so friction is exact on a slope. If the
    contact itself is level, directions are counted from `azimuth`. Both turn with the shape about the vertical.
    """
    level = np.stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1)
    lengths = np.linalg.norm(level, axis=1)
    flat = lengths < 1e-6
    level[~flat] /= lengths[~flat, None]
    level[flat] = [np.cos(azimuth), np.sin(azimuth), 0.0]
    level[flat] -= (level[flat] * normals[flat]).sum(axis=1)[:, None] * normals[flat]
    steep = np.cross(normals, level)
    angles = 2 * np.pi * np.arange(directions) / directions
    rubbing = np.cos(angles)[None, :, None] * level[:, None] + np.sin(angles)[None, :, None] * steep[:, None]
    edges: FloatArray = normals[:, None] + friction * rubbing
    return edges


def _wrenches(
    first: np.ndarray, second: np.ndarray, points: FloatArray, centres: FloatArray, forces: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return the wrench of each cone edge on its two bodies, float64 (c, 2, 6), and the bodies, int64 (c, 2)."""
    bodies = np.stack([first, second], axis=1).astype(np.int64)
    arms = points[:, None] - centres[bodies]
    both = np.array([1.0, -1.0])[:, None] * forces[:, :, None]
    wrenches = np.concatenate([both, np.cross(arms[:, None], both)], axis=3)
    return wrenches.reshape(-1, 2, 6), np.repeat(bodies, forces.shape[1], axis=0)


def _glue(patches: ContactPatches, centres: FloatArray, pull: FloatArray) -> FloatArray:
    """Return the load on each body, float64 (n, 6), of all glue at its limit."""
    load = np.zeros((len(centres), 6))
    for bodies, sign in ((patches.first, -1.0), (patches.second, 1.0)):
        own = bodies >= 0
        force = sign * pull[own, None] * patches.normals[own]
        arms = patches.points[own] - centres[bodies[own]]
        np.add.at(load, bodies[own], np.concatenate([force, np.cross(arms, force)], axis=1))
    return load
