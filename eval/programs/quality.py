"""Quality, variability and smoothness of generated ShapeAssembly programs and of their cuboids (shapeassembly §7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

import numpy as np

from eval.dataset.physical_validity import judge_all, stays_up
from eval.engine.shapes import box_shape
from eval.engine.table import Cell
from eval.programs.nearest import nearest_distances, paired_distances
from stages.shape.arrays import FloatArray
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape
from stages.shapeassembly.analysis.structure import program_distance, signature
from stages.shapeassembly.execution.interpreter import execute_all
from stages.shapeassembly.extraction.boxes import corners_of_box
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import even_surface_points, execution_boxes
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.latent import LatentPoints
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.program_vae.trained import TrainedProgramVae

POINTS_PER_SHAPE = 256
"""Surface points for Chamfer distances."""

DECODE_BATCH_SIZE = 128


@dataclass(frozen=True)
class PhysicalShares:
    """Percentages of rooted shapes, and of shapes that are stable under a drop and a push (App. E)."""

    rooted: float
    stable: float


def boxes_of_programs(programs: Sequence[AssemblyProgram]) -> list[list[Box]]:
    """Execute programs and return the cuboids of each."""
    return [execution_boxes(execution) for execution in execute_all(programs)]


def shape_of_boxes(boxes: Sequence[Box]) -> Shape:
    """Return the shape of some cuboids."""
    return box_shape(np.stack([corners_of_box(box) for box in boxes]), "y")


def physical_shares(samples: Sequence[Sequence[Box]]) -> PhysicalShares:
    """Judge shapes, each given by its cuboids."""
    shapes = [shape_of_boxes(boxes) for boxes in samples]
    config = PhysicsConfig()
    rooted = fmean(validity.rooted for validity in judge_all(shapes, config))
    return PhysicalShares(100 * rooted, 100 * fmean(stays_up(shapes, config)))


def clouds_of(samples: Sequence[Sequence[Box]], count: int = POINTS_PER_SHAPE) -> FloatArray:
    """Return points on the surface of the cuboids of each shape, float64 (n, count, 3)."""
    clouds = []
    for boxes in samples:
        points = even_surface_points(boxes, 2 * count)
        clouds.append(points[np.linspace(0, len(points) - 1, count).astype(int)])
    return np.stack(clouds)


@dataclass(frozen=True)
class Variability:
    """Mean Chamfer distances to the nearest shape, and the mean number of cuboids."""

    generalization: float
    """From a sample to train."""
    coverage: Cell
    """From a shape of val to the samples; empty for the shapes of val themselves."""
    variety: float
    """From a sample to the other samples."""
    leaf_parts: float


def variability(samples: Sequence[Sequence[Box]], train: FloatArray, val: FloatArray | None) -> Variability:
    """Compare shapes, given by their cuboids, with clouds (n, POINTS_PER_SHAPE, 3); None for `val` if they are val."""
    clouds = clouds_of(samples)
    return Variability(
        float(nearest_distances(clouds, train, False).mean()),
        "" if val is None else float(nearest_distances(val, clouds, False).mean()),
        float(nearest_distances(clouds, clouds, True).mean()),
        fmean(map(len, samples)),
    )


def novelty(samples: Sequence[AssemblyProgram], train: Sequence[AssemblyProgram]) -> float:
    """Return the percentage of samples whose structure train does not have (§7.1.3)."""
    known = {signature(program) for program in train}
    return 100 * fmean(signature(program) not in known for program in samples)


def sample_without_rejection(
    model: TrainedProgramVae, count: int, rng: np.random.Generator, temperature: float
) -> list[AssemblyProgram]:
    """Decode programs at random points, ending an assembly before a line that breaks a rule (§7.1.1, "no reject").

    Points without any cuboid are skipped. Raises ValueError if nearly all are.
    """
    programs: list[AssemblyProgram] = []
    max_batches = 50 * (1 + count // DECODE_BATCH_SIZE)
    for _ in range(max_batches):
        decoded = model.decode(model.sample_points(DECODE_BATCH_SIZE, rng, temperature), reject=False)
        programs += [program for program in decoded if program is not None]
        if len(programs) >= count:
            return programs[:count]
    raise ValueError(
        f"{len(programs)} of {max_batches * DECODE_BATCH_SIZE} random points gave a program; train the model longer"
    )


def smoothness(
    model: TrainedProgramVae | TrainedPartGraphVae, sequences: int, steps: int, rng: np.random.Generator
) -> tuple[Cell, Cell, float]:
    """Measure the change per step on straight lines between random latent points (§7.2).

    Return the mean Chamfer distance as a share of the diagonal, the mean edit distance of programs, and the percentage
    of points without a shape, which are skipped. The first two are empty without consecutive shapes, the second also
    for a model of cuboids.
    """
    ends = model.sample_points(2 * sequences, rng).reshape(sequences, 2, model.latent)
    shares = np.linspace(0, 1, steps, dtype=np.float32)[:, None]
    geometry, structure, failed = [], [], 0
    for first, last in ends:
        programs, samples = _decoded(model, first + shares * (last - first))
        failed += steps - len(samples)
        clouds = clouds_of(samples) if samples else np.empty((0, POINTS_PER_SHAPE, 3))
        for boxes, distance in zip(samples, paired_distances(clouds[:-1], clouds[1:]).tolist(), strict=False):
            corners = np.concatenate([corners_of_box(box) for box in boxes])
            geometry.append(distance / float(np.linalg.norm(np.ptp(corners, axis=0))))
        structure += [program_distance(*pair) for pair in pairwise(programs)]
    share = 100 * failed / (sequences * steps)
    return fmean(geometry) if geometry else "", fmean(structure) if structure else "", share


def _decoded(
    model: TrainedProgramVae | TrainedPartGraphVae, points: LatentPoints
) -> tuple[list[AssemblyProgram], Sequence[Sequence[Box]]]:
    """Return the programs, without rejection, and the cuboids at those points that have any."""
    if isinstance(model, TrainedPartGraphVae):
        return [], [boxes for boxes in model.decode(points) if boxes]
    programs = [program for program in model.decode(points, reject=False) if program is not None]
    return programs, boxes_of_programs(programs)
