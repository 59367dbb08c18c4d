"""What models of ShapeAssembly programs write, and models of the cuboids that these make: quality, variability,
smoothness (shapeassembly §7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

import numpy as np

from eval.dataset.physical_validity import judge_all, stays_up
from eval.engine.shapes import box_shape
from eval.engine.table import Cell
from eval.programs.nearest import nearest, paired
from stages.shape.arrays import FloatArray
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape
from stages.shapeassembly.analysis.structure import program_distance, signature
from stages.shapeassembly.execution.interpreter import execute_all
from stages.shapeassembly.extraction.boxes import box_corners
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import execution_boxes, surface_points
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.latent import LatentPoints
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.program_vae.trained import TrainedProgramVae

POINTS = 256
"""Points of a shape's surface that Chamfer distances are measured with."""

AT_ONCE = 128
"""Points of a latent space that are decoded at once."""


@dataclass(frozen=True)
class Physics:
    """Percent of shapes that are rooted, and that stay up when dropped and pushed (App. E)."""

    rooted: float
    stable: float


def boxes_of_programs(programs: Sequence[AssemblyProgram]) -> list[list[Box]]:
    """The cuboids of each executed program."""
    return [execution_boxes(execution) for execution in execute_all(programs)]


def shape_of_boxes(boxes: Sequence[Box]) -> Shape:
    """The shape of some cuboids."""
    return box_shape(np.stack([box_corners(box) for box in boxes]), "y")


def physics_of(samples: Sequence[Sequence[Box]]) -> Physics:
    """Of shapes of some cuboids each."""
    shapes = [shape_of_boxes(boxes) for boxes in samples]
    config = PhysicsConfig()
    rooted = fmean(each.rooted for each in judge_all(shapes, config))
    return Physics(100 * rooted, 100 * fmean(stays_up(shapes, config)))


def clouds_of(samples: Sequence[Sequence[Box]], count: int = POINTS) -> FloatArray:
    """Points on the surface of the cuboids of each shape, float64 (n, count, 3)."""
    clouds = []
    for boxes in samples:
        points = surface_points(boxes, 2 * count)
        clouds.append(points[np.linspace(0, len(points) - 1, count).astype(int)])
    return np.stack(clouds)


@dataclass(frozen=True)
class Variability:
    """Mean Chamfer distances to the nearest: generalization, of a sample in train; coverage, of a shape of val among
    the samples, empty for the shapes of val themselves; variety, of a sample among the others. leaf_parts: cuboids of a
    sample."""

    generalization: float
    coverage: Cell
    variety: float
    leaf_parts: float


def variability(samples: Sequence[Sequence[Box]], train: FloatArray, val: FloatArray | None) -> Variability:
    """Of shapes of some cuboids each, beside the clouds (n, POINTS, 3) of train and, if they are not val themselves, of
    val."""
    clouds = clouds_of(samples)
    return Variability(
        float(nearest(clouds, train, False).mean()),
        "" if val is None else float(nearest(val, clouds, False).mean()),
        float(nearest(clouds, clouds, True).mean()),
        fmean(map(len, samples)),
    )


def novelty(samples: Sequence[AssemblyProgram], train: Sequence[AssemblyProgram]) -> float:
    """Percent of samples whose structure train has not (§7.1.3)."""
    known = {signature(each) for each in train}
    return 100 * fmean(signature(each) not in known for each in samples)


def unrejected(
    model: TrainedProgramVae, count: int, rng: np.random.Generator, temperature: float
) -> list[AssemblyProgram]:
    """So many programs of random points, none of which is rejected for a line that breaks a rule: its assembly ends
    before that line (§7.1.1, "no reject"). Points that give no cuboid at all are passed over. Raises ValueError where
    nearly all do."""
    kept: list[AssemblyProgram] = []
    most = 50 * (1 + count // AT_ONCE)
    for _ in range(most):
        found = model.decode(model.sample_points(AT_ONCE, rng, temperature), reject=False)
        kept += [each for each in found if each is not None]
        if len(kept) >= count:
            return kept[:count]
    raise ValueError(f"{len(kept)} of {most * AT_ONCE} random points gave a program; train the model longer")


def smoothness(
    model: TrainedProgramVae | TrainedPartGraphVae, sequences: int, steps: int, rng: np.random.Generator
) -> tuple[Cell, Cell, float]:
    """How much changes from step to step on straight ways between random points (§7.2): Chamfer distance as a share of
    the diagonal of the bounding box, edit distance of programs; and the percent of points that gave no shape, and are
    passed over. The first two are empty where no two points in a row gave one, the second of cuboids without
    programs."""
    ends = model.sample_points(2 * sequences, rng).reshape(sequences, 2, model.latent)
    shares = np.linspace(0, 1, steps, dtype=np.float32)[:, None]
    geometry, structure, none = [], [], 0
    for first, last in ends:
        programs, samples = _decoded(model, first + shares * (last - first))
        none += steps - len(samples)
        clouds = clouds_of(samples) if samples else np.empty((0, POINTS, 3))
        for before, distance in zip(samples, paired(clouds[:-1], clouds[1:]).tolist(), strict=False):
            corners = np.concatenate([box_corners(box) for box in before])
            geometry.append(distance / float(np.linalg.norm(np.ptp(corners, axis=0))))
        structure += [program_distance(one, other) for one, other in pairwise(programs)]
    share = 100 * none / (sequences * steps)
    return fmean(geometry) if geometry else "", fmean(structure) if structure else "", share


def _decoded(
    model: TrainedProgramVae | TrainedPartGraphVae, points: LatentPoints
) -> tuple[list[AssemblyProgram], Sequence[Sequence[Box]]]:
    """The programs at points that give any, nothing rejected, and the cuboids at those that give any."""
    if isinstance(model, TrainedPartGraphVae):
        return [], [each for each in model.decode(points) if each]
    programs = [each for each in model.decode(points, reject=False) if each is not None]
    return programs, boxes_of_programs(programs)
