"""From point clouds to programs: an encoder into the latent space of a model, and fits of what is written there
(shapeassembly §7.3, Table 7)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import nn

from eval.engine.table import Cell, ReferenceRow, Table
from eval.programs.quality import boxes_of_programs, clouds_of, physics_of, shape_of_boxes
from eval.programs.two_sample_test import POINTS, features_of
from pipeline.errors import Rejected
from stages.abstraction.hierarchy import Boxes, hierarchy_of
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

NEAR = 0.02
"""Points agree that are no further apart, as a share of the diagonal of the target, as in `extraction.distance`."""

EPOCHS = 60
HIDDEN = 512

FITS = ("", " + cuboids", " + program")
"""What is done with what the model writes: nothing; its cuboids, or its program, are fitted to the points."""

Encoder = Callable[[FloatArray], LatentPoints]
"""Descriptions of clouds to points of a latent space, float32 (n, latent)."""


def described(clouds: FloatArray) -> FloatArray:
    """What an encoder sees of clouds (n, k, 3), float64 (n, d): features of a network that has seen curve chairs alone,
    which knows no size and place, and these. Raises ValueError where no network ships."""
    features = features_of(clouds)
    if features is None:
        raise ValueError("the model of chairs' clouds that comes with Shapemill is not there")
    return np.concatenate([features, clouds.min(axis=1), clouds.max(axis=1)], axis=1)


def trained_encoder(seen: FloatArray, points: LatentPoints, seed: int) -> Encoder:
    """From descriptions of clouds (n, d) to the points float32 (n, latent) at which a model has their shapes."""
    centre, spread = seen.mean(axis=0), seen.std(axis=0) + 1e-6
    unit = float(points.std()) + 1e-6
    rows, goals = torch.from_numpy((seen - centre) / spread).float(), torch.from_numpy(points / unit)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        module = nn.Sequential(
            nn.Linear(seen.shape[1], HIDDEN), nn.LeakyReLU(0.2), nn.Dropout(0.2),
            nn.Linear(HIDDEN, HIDDEN), nn.LeakyReLU(0.2), nn.Dropout(0.2), nn.Linear(HIDDEN, points.shape[1]),
        )  # fmt: skip
        batches = max(1, len(rows) // 64)
        optimizer = torch.optim.AdamW(module.parameters(), 1e-3, weight_decay=1e-2)
        falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, EPOCHS * batches)
        for _ in range(EPOCHS):
            for batch in torch.randperm(len(rows)).chunk(batches):
                optimizer.zero_grad()
                torch.autograd.backward((module(rows[batch]) - goals[batch]).square().sum(dim=1).mean())
                optimizer.step()
                falling.step()
    module.eval()

    def encode(clouds: FloatArray) -> LatentPoints:
        with torch.no_grad():
            found: LatentPoints = module(torch.from_numpy((clouds - centre) / spread).float()).numpy() * unit
        return found.astype(np.float32)

    return encode


def reconstructions(
    model: TrainedProgramVae | TrainedPartGraphVae,
    place: LatentPoints,
    cloud: FloatArray,
    rng: np.random.Generator,
    steps: int,
) -> Iterator[tuple[str, Sequence[Box]]]:
    """What a model has at a place, float32 (latent,), and after fits to a cloud (n, 3), by FITS; those that cannot be
    had are left out, such as that of a program where cuboids have none."""
    if isinstance(model, TrainedPartGraphVae):
        boxes: Sequence[Box] = model.decode(place[None])[0]
        program, centre, scale = _program_of(boxes) if boxes else (None, np.zeros(3), 1.0)
    else:
        program, centre, scale = model.decode(place[None], reject=False)[0], np.zeros(3), 1.0
        boxes = boxes_of_programs([program])[0] if program else ()
    if not boxes:
        return
    yield FITS[0], boxes
    yield FITS[1], fit_cuboids(boxes, cloud, rng, steps)
    if program is not None:
        try:
            fitted = fit(program, (cloud - centre) / scale, rng, steps).program
            found = boxes_of_programs([fitted])[0]
        except ProgramError:
            return
        yield FITS[2], [replace(box, center=centre + scale * box.center, size=scale * box.size) for box in found]


def _program_of(boxes: Sequence[Box]) -> tuple[AssemblyProgram | None, FloatArray, float]:
    """The program that is extracted of cuboids, with the centre and the scale of its coordinates; None where none is
    found."""
    try:
        hierarchy = hierarchy_of(shape_of_boxes(boxes), AbstractionConfig().children, Boxes())
        found = extract(hierarchy, CATEGORY_RULES["any"], Gates(), Cleaning())
    except Rejected:
        return None, np.zeros(3), 1.0
    return found.program, found.center, found.scale


def f_score(boxes: Sequence[Box], cloud: FloatArray) -> float:
    """F-score from 0 to 100 of the surface of cuboids against a cloud (n, 3), by as many points (Knapitsch and others
    2017)."""
    made = clouds_of([boxes], len(cloud))[0]
    near = NEAR * float(np.linalg.norm(np.ptp(cloud, axis=0)))
    precision, recall = (
        float((cKDTree(other).query(each)[0] <= near).mean()) for each, other in ((made, cloud), (cloud, made))
    )
    return 200 * precision * recall / (precision + recall) if precision + recall else 0.0


@dataclass(frozen=True)
class Rebuilt:
    """The shapes of a row, and beside each points (n, 3) on the surface that it should have."""

    boxes: list[Sequence[Box]]
    clouds: list[FloatArray]


def clouds_table(rows: Mapping[str, Rebuilt]) -> Table:
    """Table 7 of the paper."""
    figures = {
        "StructureNet": (24.3, 95.1, 78.4), "ShapeAssembly": (31.1, 95.5, 84.4),
        "StructureNet + cuboids": (80.0, 92.9, 72.7), "StructureNet + program": (77.4, 90.0, 71.9),
        "ShapeAssembly + cuboids": (77.6, 93.1, 72.9), "ShapeAssembly + program": (75.8, 95.3, 80.2),
    }  # fmt: skip
    columns = ("F1", "rooted %", "stable %")
    cells: list[tuple[Cell, ...]] = []
    for name, each in rows.items():
        found = physics_of(each.boxes)
        scores = [f_score(boxes, cloud) for boxes, cloud in zip(each.boxes, each.clouds, strict=True)]
        cells.append((name, len(each.boxes), fmean(scores), found.rooted, found.stable))
    notes = (
        f"A surrogate for dense meshes, which cannot be had: clouds of {POINTS} points on the cuboids of val. F1 at "
        f"{100 * NEAR:.0f} % of the diagonal. The encoder is trained here, on clouds of train, from features of the "
        "encoder for clouds of chairs that comes with Shapemill to the points of the latent space.",
        "Shapes: those for which it can be had; cuboids without attachments have a program where one can be extracted.",
    )
    published = [
        ReferenceRow(f"chair, {name}", "shapeassembly Table 7, of dense meshes", dict(zip(columns, row, strict=True)))
        for name, row in figures.items()
    ]
    return Table("From clouds to programs", ("shapes of", "shapes", *columns), tuple(cells), notes, published)
