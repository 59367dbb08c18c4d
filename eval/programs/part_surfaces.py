"""Surfaces within cuboids: a point cloud for each part of a generated shape (shapeassembly §7.1.5, figure 11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Tensor, nn

from eval.engine.evaluation import Figure
from eval.engine.pictures import cloud_portrait
from eval.programs.figures import boxes_portrait, picture_figure
from stages.abstraction.hierarchy import MAX_TURNED_VOLUME_SHARE
from stages.programs.program import find_program
from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import corners_of_box, nearest_axes
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box
from stages.shapeassembly.extraction.validity import even_surface_points
from stages.training.latent import reparameterize
from stages.training.recovery.shapes import TRAIN_INTERVAL, random_training_shapes
from stages.training.recovery.surface import even_points

POINTS_PER_PART = 256

STYLE_DIMENSIONS = 8
"""Latent dimensions of the surface of a part, given its cuboid."""

HIDDEN_UNITS = 128
BATCH_SIZE = 32
DIVERGENCE_WEIGHT = 1e-4
"""Of the divergence from the prior, in nats, relative to mean squared distances in units of cuboids."""


@dataclass(frozen=True)
class PartClouds:
    """The surfaces of parts and the cuboids around them."""

    points: FloatArray
    """float32 (n, POINTS_PER_PART, 3), in coordinates of the cuboid, from -0.5 to 0.5."""
    features: FloatArray
    """float32 (n, 9), as `box_features`."""


def box_features(boxes: Sequence[Box]) -> FloatArray:
    """Return the network inputs of each cuboid of a shape, (n, 9): its size, its centre, and its second axis.

    Lengths are shares of the largest side of the shape; the origin is the middle of its ground.
    """
    corners = np.concatenate([corners_of_box(box) for box in boxes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = float((high - low).max())
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return np.stack([np.concatenate([b.size / side, (b.center - middle) / side, b.axes[:, 1]]) for b in boxes])


def curve_parts(program: str, shapes: int, rng: np.random.Generator) -> PartClouds:
    """Return the parts of random shapes of a curve program."""
    points, features = [], []
    for shape in islice(random_training_shapes(find_program(program), TRAIN_INTERVAL, rng), shapes):
        meshes = [part.mesh for part in shape.parts]
        boxes = [nearest_axes(minimum_box(mesh.vertices, MAX_TURNED_VOLUME_SHARE), np.eye(3)) for mesh in meshes]
        for mesh, box in zip(meshes, boxes, strict=True):
            local = (even_points(mesh.vertices, mesh.triangles, POINTS_PER_PART) - box.center) @ box.axes.T
            points.append(local / np.maximum(box.size, 1e-6))
        features.append(box_features(boxes))
    return PartClouds(np.stack(points).astype(np.float32), np.concatenate(features).astype(np.float32))


class PartSurfaces(nn.Module):
    """A VAE of the surfaces of parts, given their cuboids; its decoder moves each point of a cuboid's surface."""

    def __init__(self) -> None:
        super().__init__()
        self.point_features = nn.Sequential(
            nn.Linear(12, HIDDEN_UNITS), nn.ReLU(), nn.Linear(HIDDEN_UNITS, HIDDEN_UNITS), nn.ReLU()
        )
        self.style = nn.Linear(HIDDEN_UNITS, 2 * STYLE_DIMENSIONS)
        self.offset = nn.Sequential(
            nn.Linear(12 + STYLE_DIMENSIONS, HIDDEN_UNITS), nn.ReLU(),
            nn.Linear(HIDDEN_UNITS, HIDDEN_UNITS), nn.ReLU(), nn.Linear(HIDDEN_UNITS, 3)
        )  # fmt: skip
        unit = Box(np.zeros(3), np.ones(3), np.eye(3))
        template = even_surface_points([unit], 2 * POINTS_PER_PART)
        rows = np.linspace(0, len(template) - 1, POINTS_PER_PART).astype(int)
        self.template: Tensor
        self.register_buffer("template", torch.from_numpy(template[rows]).float())

    def encode(self, points: Tensor, features: Tensor) -> tuple[Tensor, Tensor]:
        """Return mean and log variance of the styles, float (n, STYLE_DIMENSIONS), of clouds (n, k, 3)."""
        rows = torch.cat([points, features[:, None].expand(-1, points.shape[1], -1)], dim=-1)
        mean, log_variance = self.style(self.point_features(rows).amax(dim=1)).split(STYLE_DIMENSIONS, dim=-1)
        return mean, log_variance

    def decode(self, styles: Tensor, features: Tensor) -> Tensor:
        """Return clouds (n, POINTS_PER_PART, 3) in coordinates of the cuboids."""
        start = self.template.expand(len(styles), -1, -1)
        condition = torch.cat([styles, features], dim=-1)[:, None].expand(-1, POINTS_PER_PART, -1)
        clouds: Tensor = (start + self.offset(torch.cat([start, condition], dim=-1))).clamp(-0.5, 0.5)
        return clouds


def train_surfaces(parts: PartClouds, steps: int, seed: int) -> PartSurfaces:
    """Train a model of these parts; the result depends on parts, steps and seed alone."""
    points, features = torch.from_numpy(parts.points), torch.from_numpy(parts.features)
    noise = torch.Generator().manual_seed(seed)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        module = PartSurfaces()
    optimizer = torch.optim.Adam(module.parameters(), 2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(steps):
        rows = torch.randint(len(points), (BATCH_SIZE,), generator=noise)
        # Distances are in space, where a thin part is thin; all sizes of parts have equal weight.
        sizes = features[rows, None, :3]
        sizes = sizes / sizes.amax(dim=-1, keepdim=True)
        styles, divergence = reparameterize(*module.encode(points[rows], features[rows]), noise)
        squared = torch.cdist(module.decode(styles, features[rows]) * sizes, points[rows] * sizes).square()
        loss = squared.amin(dim=1).mean() + squared.amin(dim=2).mean() + DIVERGENCE_WEIGHT * divergence
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        schedule.step()
    return module.eval()


@torch.no_grad()
def surface_of(module: PartSurfaces, boxes: Sequence[Box], rng: np.random.Generator) -> FloatArray:
    """Return points (n, 3) on the surfaces of all parts of a shape, in one style."""
    aligned = [nearest_axes(box, np.eye(3)) for box in boxes]
    style = torch.from_numpy(rng.standard_normal(STYLE_DIMENSIONS)).float().expand(len(aligned), -1)
    clouds = module.decode(style, torch.from_numpy(box_features(aligned)).float()).double().numpy()
    return np.concatenate(
        [box.center + (cloud * box.size) @ box.axes for box, cloud in zip(aligned, clouds, strict=True)]
    )


def surfaces_figure(
    name: str, category: str, module: PartSurfaces, shapes: Sequence[Sequence[Box]], rng: np.random.Generator
) -> Figure:
    """Return figure 11: cuboids of generated programs, and surfaces within them."""
    rows = {
        f"Cuboids of programs generated by {name}": [
            (f"{len(boxes)} parts", boxes_portrait(boxes)) for boxes in shapes
        ],
        "Surface points within them": [("", cloud_portrait(surface_of(module, boxes, rng))) for boxes in shapes],
    }
    return picture_figure(f"figure11_{name}", f"Figure 11, {category}: surfaces trained on parts of curve shapes", rows)
