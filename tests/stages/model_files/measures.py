"""What a scene holds, as numbers that two readers can be compared by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.model_files.scene import ModelScene


@dataclass(frozen=True)
class Measured:
    """A part in the world. colors: all of its face colours, sorted."""

    name: str
    low: np.ndarray
    high: np.ndarray
    area: float
    volume: float
    colors: list[tuple[int, ...]]


def measured(scene: ModelScene) -> list[Measured]:
    """Return the measures of each placement of a scene."""
    parts = []
    for place in scene.placements:
        surface = scene.surfaces[place.surface]
        points = surface.vertices @ place.pose[:3, :3].T + place.pose[:3, 3]
        a, b, c = np.moveaxis(points[surface.faces], 1, 0)
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
        volume = float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
        colors = sorted(map(tuple, np.unique(surface.face_colors, axis=0).tolist()))
        parts.append(Measured(place.name, points.min(axis=0), points.max(axis=0), area, volume, colors))
    return parts
