"""Fit the continuous parameters of a program, or free cuboids, to a point cloud (shapeassembly §7.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from stages.shape.arrays import FloatArray
from stages.shape.geometry.clouds import chamfer_l1
from stages.shapeassembly.execution.differentiable import DifferentiableProgram
from stages.shapeassembly.execution.interpreter import Execution, execute
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE, parameter_ranges, parameters, with_parameters
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import AssemblyProgram

_SIGNS = torch.tensor([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (0.5, -0.5)], dtype=torch.float64)

STEPS_PER_RESAMPLING = 20
"""Steps between new samples of surface points."""


@dataclass(frozen=True)
class FitResult:
    """A fitted program.

    before, after: Chamfer distance to the points, measured at other surface points than the fit has used.
    """

    program: AssemblyProgram
    before: float
    after: float


def fit(
    program: AssemblyProgram,
    points: FloatArray,
    rng: np.random.Generator,
    steps: int = 200,
    rate: float = 0.01,
    samples: int = 2000,
) -> FitResult:
    """Move the parameters of a program so that its surface approximates points, float64 (n, 3).

    Adam minimises the mean squared distances both ways to the nearest point, for `samples` surface points at a time;
    the rate falls to a tenth. Parameters stay in their ranges. The best step is kept; the fit ends at a step whose
    program cannot be executed. Raises ProgramError if the program itself cannot be executed, ValueError if there are no
    points or no parts.
    """
    differentiable = DifferentiableProgram(program)
    low, high = parameter_ranges(program)
    fitted = with_parameters(
        program, _descended(differentiable.corners, parameters(program), low, high, points, rng, steps, rate, samples)
    )
    states = rng.spawn(2)
    before, after = (
        chamfer_l1(sampled_surface_points(execute(candidate), samples, state), points)
        for candidate, state in zip((program, fitted), states, strict=True)
    )
    return FitResult(fitted, before, after)


def fit_cuboids(
    boxes: Sequence[Box],
    points: FloatArray,
    rng: np.random.Generator,
    steps: int = 200,
    rate: float = 0.01,
    samples: int = 2000,
) -> list[Box]:
    """Move, stretch and turn cuboids independently, as `fit` does with a program (§7.3, "Opt Cuboids").

    Raises ValueError if there are no points or no cuboids.
    """
    if not boxes:
        raise ValueError("there are no cuboids to fit")
    start = np.stack([np.concatenate([box.center, box.size, np.zeros(3)]) for box in boxes])
    axes = torch.from_numpy(np.stack([box.axes for box in boxes]))
    low = np.full(start.shape, -np.inf)
    low[:, 3:6] = np.minimum(start[:, 3:6], MIN_CUBOID_SIZE)

    def placed(values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return centres (n, 3), sizes (n, 3) and axes (n, 3, 3) as rows."""
        centres, sizes, turns = values.view(-1, 3, 3).unbind(1)
        skew = torch.linalg.cross(turns[:, None], torch.eye(3, dtype=torch.float64)[None], dim=-1)
        return centres, sizes, axes @ torch.linalg.matrix_exp(skew)

    def corners(values: Tensor) -> Tensor:
        centres, sizes, turned = placed(values)
        return centres[:, None] + (_SIGNS * sizes[:, None]) @ turned

    best = _descended(corners, start.ravel(), low.ravel(), np.inf, points, rng, steps, rate, samples)
    centres, sizes, turned = (tensor.numpy() for tensor in placed(torch.from_numpy(best)))
    return [Box(*box) for box in zip(centres, sizes, turned, strict=True)]


def _descended(
    corners_of: Callable[[Tensor], Tensor],
    start: FloatArray,
    low: FloatArray | float,
    high: FloatArray | float,
    points: FloatArray,
    rng: np.random.Generator,
    steps: int,
    rate: float,
    samples: int,
) -> FloatArray:
    """Return the values, (k,), with the smallest distance to the points during the descent from `start`.

    corners_of: the corners of the cuboids, (n, 8, 3), at some values.
    """
    if not len(points):
        raise ValueError("there are no points to fit to")
    target = cKDTree(points)
    values = torch.tensor(start, requires_grad=True)
    optimiser = torch.optim.Adam([values], lr=rate)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, eta_min=rate / 10)
    cloud = torch.from_numpy(np.asarray(points, dtype=np.float64))
    best, best_values = np.inf, values.detach().clone()
    cuboids, weights = np.empty(0, np.int64), torch.empty(0, 8)
    for step in range(steps):
        try:
            corners = corners_of(values)
        except ProgramError:
            if step == 0:
                raise
            break
        if step % STEPS_PER_RESAMPLING == 0:
            cuboids, weights = _chosen_points(corners.detach().numpy(), samples, rng)
        surface = (corners[cuboids] * weights[:, :, None]).sum(dim=1)
        loss, distance = _squared_chamfer(surface, cloud, target)
        if distance < best:
            best, best_values = distance, values.detach().clone()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        if not bool(torch.isfinite(values.grad).all()):  # type: ignore[arg-type]
            break
        optimiser.step()
        falling.step()
        with torch.no_grad():
            values.copy_(torch.minimum(torch.maximum(values, _bound(low)), _bound(high)))
    return best_values.numpy()


def _bound(values: FloatArray | float) -> Tensor:
    return torch.as_tensor(values, dtype=torch.float64)


def sampled_surface_points(execution: Execution, count: int, rng: np.random.Generator) -> FloatArray:
    """Sample the surfaces of all leaf cuboids uniformly by area, float64 (count, 3)."""
    cuboids, weights = _chosen_points(execution.corners, count, rng)
    points: FloatArray = (execution.corners[cuboids] * weights.numpy()[:, :, None]).sum(axis=1)
    return points


def _chosen_points(corners: FloatArray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, Tensor]:
    """Sample surface points uniformly by area:

    the cuboid of each, int64 (count,), and weights of its corners, float64 (count, 8).
    """
    if not len(corners):
        raise ValueError("the program has no parts")
    sizes = np.linalg.norm(corners[:, [4, 2, 1]] - corners[:, :1], axis=2)
    areas = np.repeat(sizes[:, [1, 0, 0]] * sizes[:, [2, 2, 1]], 2, axis=1).ravel()
    faces = np.searchsorted(np.cumsum(areas) / areas.sum(), rng.random(count), side="right").clip(max=len(areas) - 1)
    local = rng.random((count, 3))
    local[np.arange(count), faces % 6 // 2] = 1 - faces % 2
    signs = np.array([[x, y, z] for x in (1, 0) for y in (1, 0) for z in (1, 0)])
    weights = np.where(signs == 1, local[:, None], 1 - local[:, None]).prod(axis=2)
    return faces // 6, torch.from_numpy(weights)


def _squared_chamfer(surface: Tensor, points: Tensor, target: cKDTree) -> tuple[Tensor, float]:
    """Return the mean squared nearest distances both ways, differentiable, and the Chamfer distance.

    Nearest points are looked up in trees: to first order they do not depend on the parameters.
    """
    here = surface.detach().numpy()
    there, nearest = target.query(here)
    back, back_nearest = cKDTree(here).query(target.data)
    loss = (surface - points[nearest]).square().sum(dim=1).mean()
    loss = loss + (points - surface[back_nearest]).square().sum(dim=1).mean()
    return loss, float(there.mean() + back.mean())
