"""Programs of point clouds: an encoder into the latent space of a model, and fits of what it decodes (shapeassembly
§7.3, Table 7)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import nn

from eval.engine.table import Cell, ReferenceRow, Table
from eval.programs.quality import boxes_of_programs, clouds_of, physical_shares, shape_of_boxes
from eval.programs.two_sample_test import POINTS_PER_CLOUD, features_of
from pipeline.errors import Rejected
from stages.abstraction.hierarchy import Boxes, part_hierarchy
from stages.abstraction.settings import AbstractionConfig
from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.fitting import fit, fit_cuboids
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.settings import Cleaning, Gates
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.latent import LatentPoints
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.program_vae.trained import TrainedProgramVae

MATCH_DISTANCE_SHARE = 0.02
"""Greatest distance of matching points, as a share of the target's diagonal, as in `extraction.distance`."""

TRAINING_EPOCHS = 60
HIDDEN_UNITS = 512

FIT_SUFFIXES = ("", " + cuboids", " + program")
"""The decoded shape as it is; with its cuboids, or its program, fitted to the points."""

Encoder = Callable[[FloatArray], LatentPoints]
"""From descriptors of clouds, float64 (n, d), to latent points, float32 (n, latent)."""


def cloud_descriptors(clouds: FloatArray) -> FloatArray:
    """Return the inputs of the encoder for clouds (n, k, 3), float64 (n, d): network features, and the bounding box.

    The network was trained on curve chairs alone, and its features do not depend on size and position. Raises
    ValueError if it is not there.
    """
    features = features_of(clouds)
    if features is None:
        raise ValueError("the pretrained recovery model of chairs and point clouds is not there")
    return np.concatenate([features, clouds.min(axis=1), clouds.max(axis=1)], axis=1)


def train_cloud_encoder(descriptors: FloatArray, points: LatentPoints, seed: int) -> Encoder:
    """Train an encoder from descriptors of clouds (n, d) to latent points of their shapes, float32 (n, latent)."""
    centre, scale = descriptors.mean(axis=0), descriptors.std(axis=0) + 1e-6
    unit = float(points.std()) + 1e-6
    inputs, targets = torch.from_numpy((descriptors - centre) / scale).float(), torch.from_numpy(points / unit)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        module = nn.Sequential(
            nn.Linear(descriptors.shape[1], HIDDEN_UNITS), nn.LeakyReLU(0.2), nn.Dropout(0.2),
            nn.Linear(HIDDEN_UNITS, HIDDEN_UNITS), nn.LeakyReLU(0.2), nn.Dropout(0.2),
            nn.Linear(HIDDEN_UNITS, points.shape[1]),
        )  # fmt: skip
        batches = max(1, len(inputs) // 64)
        optimizer = torch.optim.AdamW(module.parameters(), 1e-3, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, TRAINING_EPOCHS * batches)
        for _ in range(TRAINING_EPOCHS):
            for batch in torch.randperm(len(inputs)).chunk(batches):
                optimizer.zero_grad()
                torch.autograd.backward((module(inputs[batch]) - targets[batch]).square().sum(dim=1).mean())
                optimizer.step()
                schedule.step()
    module.eval()

    def encode(clouds: FloatArray) -> LatentPoints:
        with torch.no_grad():
            encoded: LatentPoints = module(torch.from_numpy((clouds - centre) / scale).float()).numpy() * unit
        return encoded.astype(np.float32)

    return encode


def reconstructions(
    model: TrainedProgramVae | TrainedPartGraphVae,
    point: LatentPoints,
    cloud: FloatArray,
    rng: np.random.Generator,
    steps: int,
) -> Iterator[tuple[str, Sequence[Box]]]:
    """Yield the cuboids decoded at a latent point, float32 (latent,), and fitted to a cloud (n, 3), by FIT_SUFFIXES.

    Those that do not exist are left out, such as the fit of a program to cuboids without one.
    """
    if isinstance(model, TrainedPartGraphVae):
        boxes: Sequence[Box] = model.decode(point[None])[0]
        program, centre, scale = _program_of(boxes) if boxes else (None, np.zeros(3), 1.0)
    else:
        program, centre, scale = model.decode(point[None], reject=False)[0], np.zeros(3), 1.0
        boxes = boxes_of_programs([program])[0] if program else ()
    if not boxes:
        return
    yield FIT_SUFFIXES[0], boxes
    yield FIT_SUFFIXES[1], fit_cuboids(boxes, cloud, rng, steps)
    if program is not None:
        try:
            fitted = fit(program, (cloud - centre) / scale, rng, steps).program
            fitted_boxes = boxes_of_programs([fitted])[0]
        except ProgramError:
            return
        yield (
            FIT_SUFFIXES[2],
            [replace(box, center=centre + scale * box.center, size=scale * box.size) for box in fitted_boxes],
        )


def _program_of(boxes: Sequence[Box]) -> tuple[AssemblyProgram | None, FloatArray, float]:
    """Return the program extracted from cuboids, or None, and the centre and scale of its coordinates."""
    try:
        hierarchy = part_hierarchy(shape_of_boxes(boxes), AbstractionConfig().children, Boxes())
        extracted = extract(hierarchy, CATEGORY_RULES["any"], Gates(), Cleaning())
    except Rejected:
        return None, np.zeros(3), 1.0
    return extracted.program, extracted.center, extracted.scale


def cloud_f_score(boxes: Sequence[Box], cloud: FloatArray) -> float:
    """Return the F-score from 0 to 100 of the surface of cuboids against a cloud (n, 3) (Knapitsch et al. 2017)."""
    surface = clouds_of([boxes], len(cloud))[0]
    max_distance = MATCH_DISTANCE_SHARE * float(np.linalg.norm(np.ptp(cloud, axis=0)))
    precision, recall = (
        float((cKDTree(other).query(points)[0] <= max_distance).mean())
        for points, other in ((surface, cloud), (cloud, surface))
    )
    return 200 * precision * recall / (precision + recall) if precision + recall else 0.0


@dataclass(frozen=True)
class ReconstructedShapes:
    """The shapes of a row, and for each points (n, 3) of the true surface."""

    boxes: list[Sequence[Box]]
    clouds: list[FloatArray]


def clouds_table(rows: Mapping[str, ReconstructedShapes]) -> Table:
    """Return Table 7 of the paper."""
    published = {
        "StructureNet": (24.3, 95.1, 78.4), "ShapeAssembly": (31.1, 95.5, 84.4),
        "StructureNet + cuboids": (80.0, 92.9, 72.7), "StructureNet + program": (77.4, 90.0, 71.9),
        "ShapeAssembly + cuboids": (77.6, 93.1, 72.9), "ShapeAssembly + program": (75.8, 95.3, 80.2),
    }  # fmt: skip
    columns = ("F1", "rooted %", "stable %")
    cells: list[tuple[Cell, ...]] = []
    for name, shapes in rows.items():
        physics = physical_shares(shapes.boxes)
        scores = [cloud_f_score(boxes, cloud) for boxes, cloud in zip(shapes.boxes, shapes.clouds, strict=True)]
        cells.append((name, len(shapes.boxes), fmean(scores), physics.rooted, physics.stable))
    notes = (
        f"Surrogate for dense meshes, which are not available: clouds of {POINTS_PER_CLOUD} points on cuboids of val. "
        f"F1 at {100 * MATCH_DISTANCE_SHARE:.0f} % of the diagonal. The encoder is trained here on clouds of train, "
        "from features of the pretrained recovery model of chairs to latent points.",
        "Shapes: those for which the method has a result; of cuboids without attachments a program is extracted.",
    )
    references = [
        ReferenceRow(f"chair, {name}", "shapeassembly Table 7, of dense meshes", dict(zip(columns, row, strict=True)))
        for name, row in published.items()
    ]
    return Table("From clouds to programs", ("shapes of", "shapes", *columns), tuple(cells), notes, references)
