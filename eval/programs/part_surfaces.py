"""Surfaces within cuboids: a point cloud for each part of a shape that a program makes (shapeassembly §7.1.5, figure
11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Tensor, nn

from eval.engine.evaluation import Figure
from eval.engine.pictures import cloud_portrait
from eval.programs.figures import drawn, sheet_of
from stages.abstraction.hierarchy import MIN_TURN_GAIN
from stages.programs.program import find_program
from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import box_corners, nearest_axes
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box
from stages.shapeassembly.extraction.validity import surface_points
from stages.training.latent import reparameterize as drawn_points
from stages.training.recovery.shapes import TRAIN_INTERVAL, random_shapes
from stages.training.recovery.surface import even_points

POINTS = 256
"""Points of a part."""

STYLE = 8
"""Dimensions of what tells the surface of one part from that of another in the same cuboid."""

HIDDEN = 128
BATCH = 32
DIVERGENCE = 1e-4
"""Weight of the divergence from the prior, in nats, beside mean squared distances in units of cuboids."""


@dataclass(frozen=True)
class PartClouds:
    """Parts as their surfaces and the cuboids around them. points: float32 (n, POINTS, 3), in the cuboid, which goes
    from -0.5 to 0.5; places: float32 (n, 9), as `places_of`."""

    points: FloatArray
    places: FloatArray


def places_of(boxes: Sequence[Box]) -> FloatArray:
    """What is seen of each cuboid of a shape, (n, 9): its size and its centre, as shares of the largest side of the
    shape and from the middle of its ground, and how its axes lean."""
    corners = np.concatenate([box_corners(each) for each in boxes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = float((high - low).max())
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return np.stack([np.concatenate([b.size / side, (b.center - middle) / side, b.axes[:, 1]]) for b in boxes])


def curve_parts(program: str, shapes: int, rng: np.random.Generator) -> PartClouds:
    """The parts of random shapes of a curve program: the surfaces that cuboids stand for."""
    points, places = [], []
    for shape in islice(random_shapes(find_program(program), TRAIN_INTERVAL, rng), shapes):
        meshes = [part.mesh for part in shape.parts]
        boxes = [nearest_axes(minimum_box(mesh.vertices, MIN_TURN_GAIN), np.eye(3)) for mesh in meshes]
        for mesh, box in zip(meshes, boxes, strict=True):
            local = (even_points(mesh.vertices, mesh.triangles, POINTS) - box.center) @ box.axes.T
            points.append(local / np.maximum(box.size, 1e-6))
        places.append(places_of(boxes))
    return PartClouds(np.stack(points).astype(np.float32), np.concatenate(places).astype(np.float32))


class PartSurfaces(nn.Module):
    """A VAE of the surfaces of parts, which knows their cuboids; its decoder moves each point of a cuboid's surface."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = nn.Sequential(nn.Linear(12, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU())
        self.told = nn.Linear(HIDDEN, 2 * STYLE)
        self.moved = nn.Sequential(
            nn.Linear(12 + STYLE, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 3)
        )  # fmt: skip
        unit = Box(np.zeros(3), np.ones(3), np.eye(3))
        template = surface_points([unit], 2 * POINTS)
        rows = np.linspace(0, len(template) - 1, POINTS).astype(int)
        self.template: Tensor
        self.register_buffer("template", torch.from_numpy(template[rows]).float())

    def encode(self, points: Tensor, places: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the variance of the styles, float (n, STYLE) each, of clouds (n, k, 3)."""
        rows = torch.cat([points, places[:, None].expand(-1, points.shape[1], -1)], dim=-1)
        mean, log_variance = self.told(self.seen(rows).amax(dim=1)).split(STYLE, dim=-1)
        return mean, log_variance

    def decode(self, styles: Tensor, places: Tensor) -> Tensor:
        """Clouds (n, POINTS, 3) in the cuboids."""
        start = self.template.expand(len(styles), -1, -1)
        told = torch.cat([styles, places], dim=-1)[:, None].expand(-1, POINTS, -1)
        found: Tensor = (start + self.moved(torch.cat([start, told], dim=-1))).clamp(-0.5, 0.5)
        return found


def trained_surfaces(parts: PartClouds, steps: int, seed: int) -> PartSurfaces:
    """A model of these parts, by its seed alone."""
    points, places = torch.from_numpy(parts.points), torch.from_numpy(parts.places)
    noise = torch.Generator().manual_seed(seed)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        module = PartSurfaces()
    optimizer = torch.optim.Adam(module.parameters(), 2e-3)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(steps):
        rows = torch.randint(len(points), (BATCH,), generator=noise)
        # Distances are those of space, where a thin part is thin; a part of any size counts alike.
        sizes = places[rows, None, :3]
        sizes = sizes / sizes.amax(dim=-1, keepdim=True)
        styles, divergence = drawn_points(*module.encode(points[rows], places[rows]), noise)
        apart = torch.cdist(module.decode(styles, places[rows]) * sizes, points[rows] * sizes).square()
        loss = apart.amin(dim=1).mean() + apart.amin(dim=2).mean() + DIVERGENCE * divergence
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        falling.step()
    return module.eval()


@torch.no_grad()
def surface_of(module: PartSurfaces, boxes: Sequence[Box], rng: np.random.Generator) -> FloatArray:
    """Points (n, 3) on the surfaces of all parts of a shape, in one style."""
    named = [nearest_axes(each, np.eye(3)) for each in boxes]
    style = torch.from_numpy(rng.standard_normal(STYLE)).float().expand(len(named), -1)
    clouds = module.decode(style, torch.from_numpy(places_of(named)).float()).double().numpy()
    return np.concatenate(
        [box.center + (cloud * box.size) @ box.axes for box, cloud in zip(named, clouds, strict=True)]
    )


def surfaces_sheet(
    name: str, category: str, module: PartSurfaces, shapes: Sequence[Sequence[Box]], rng: np.random.Generator
) -> Figure:
    """Figure 11: cuboids that a program of a model makes, and surfaces within them."""
    rows = {
        f"Cuboids of programs written by {name}": [(f"{len(each)} parts", drawn(each)) for each in shapes],
        "Points of surfaces in them": [("", cloud_portrait(surface_of(module, each, rng))) for each in shapes],
    }
    return sheet_of(f"figure11_{name}", f"Figure 11, {category}: surfaces learnt from parts of curve shapes", rows)
