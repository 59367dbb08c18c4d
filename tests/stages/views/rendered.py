"""Views of small shapes, and what an independent ray caster sees of them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape
from stages.shape.views.scene import scene_of
from stages.views.cameras import sample_views
from stages.views.images import view_files
from stages.views.placement import bounding_sphere
from stages.views.reading import SampleView, read_views
from stages.views.render import ViewRenderer
from stages.views.settings import ViewsConfig
from stages.views.shading import lamp_of
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type

ALL_IMAGES = ["color", "depth", "normals", "instances", "classes", "mask", "drawing"]
CAMERAS = [
    {"kind": "ring", "count": 2, "elevation": 25.0, "azimuth": -40.0},
    {"kind": "random", "count": 2, "fov": 70.0, "distance": 1.8},
    {"kind": "sphere", "count": 2, "projection": "orthographic"},
]


def lopsided() -> Shape:
    """Parts of different colours and sizes, turned and far from the origin; two have faces in one plane."""
    kit = kit_of(
        part_type("slab", box((3.0, 0.4, 1.6)), (200, 120, 60)),
        part_type("post", box((0.5, 2.0, 0.7)), (30, 90, 160)),
        part_type("drum", cylinder(24, 0.5, 0.8), (240, 240, 235)),
    )
    c, s = np.cos(0.4), np.sin(0.4)
    poses = np.tile(np.eye(4), (4, 1, 1))
    offsets = [(0.0, 0.0, 0.0), (1.2, 1.2, 0.3), (-1.0, 0.6, -0.4), (0.2, 1.6, 0.6)]
    poses[:, :3, 3] = np.array(offsets) + np.array([7.0, -2.0, 4.0])
    poses[1, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    poses[3, :3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    edges = np.array([[0, 1], [0, 2]], dtype=np.int32)
    return kit_shape(kit, Assembly(np.array([0, 1, 2, 1], np.int16), poses, edges))


def wires() -> Shape:
    """A slab under a fan of wires that are thinner than a pixel."""
    kit = kit_of(
        part_type("slab", box((3.0, 0.4, 3.0)), (200, 120, 60)), part_type("wire", box((0.012, 2.0, 0.012)), (9, 9, 9))
    )
    poses = np.tile(np.eye(4), (9, 1, 1))
    for number, angle in enumerate(np.linspace(-0.9, 0.9, 8), start=1):
        c, s = np.cos(angle), np.sin(angle)
        poses[number, :3] = [[c, -s, 0, -s], [s, c, 0, c + 0.1], [0, 0, 1, 0.1 * number]]
    return kit_shape(kit, Assembly(np.array([0] + 8 * [1], np.int16), poses, np.empty((0, 2), dtype=np.int32)))


def files_of(shape: Shape, config: ViewsConfig) -> tuple[dict[str, bytes], list[dict[str, Any]]]:
    """Return the image files of a shape, and its cameras as the record has them."""
    scene, color = scene_of(shape), config.color
    sphere = bounding_sphere(scene)
    lamp = lamp_of(scene, sphere, color.light_azimuth, color.light_elevation, color.shadows)
    files: dict[str, bytes] = {}
    cameras = []
    for index, (_, view) in enumerate(sample_views(config, sphere, np.random.default_rng)):
        renderer = ViewRenderer(scene, view, config.width, config.height)
        own, fields = view_files(config, renderer, lamp if color.lighting == "lit" else None, shape.part_classes, index)
        files |= own
        cameras.append(json.loads(json.dumps(fields)))
    return files, cameras


def views_of(shape: Shape, **keys: Any) -> tuple[SampleView, ...]:
    """Return the views of a shape as a user reads them; `keys` are of the section `views`."""
    config = ViewsConfig.model_validate({"cameras": CAMERAS, "width": 96, "height": 80, "images": ALL_IMAGES, **keys})
    return read_views(*files_of(shape, config))


def triangles_of(shape: Shape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (t, 3, 3), part (t,) and sRGB colour (t, 3) of all triangles in the world."""
    corners, parts, colors = [], [], []
    for part, (kind, pose) in enumerate(zip(shape.assembly.types, shape.assembly.poses, strict=True)):
        mesh = shape.meshes[kind]
        corners.append((mesh.vertices @ pose[:3, :3].T + pose[:3, 3])[mesh.faces])
        parts.append(np.full(len(mesh.faces), part))
        colors.append(mesh.face_colors)
    return np.concatenate(corners), np.concatenate(parts), np.concatenate(colors)


def rays_of(camera: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (h, w, 3) of the rays through the middles of pixels, as a reader of the card writes it."""
    k, pose = np.array(camera["intrinsics"]), np.linalg.inv(np.array(camera["world_to_camera"]))
    x = (np.arange(camera["width"]) + 0.5 - k[0, 2]) / k[0, 0]
    y = (np.arange(camera["height"]) + 0.5 - k[1, 2]) / k[1, 1]
    x, y = np.meshgrid(x, y)
    if camera["projection"] == "perspective":
        start, ahead = np.zeros((*x.shape, 3)), np.stack([x, y, np.ones_like(x)], axis=-1)
    else:
        start = np.stack([x, y, np.zeros_like(x)], axis=-1)
        ahead = np.broadcast_to([0.0, 0.0, 1.0], start.shape)
    return start @ pose[:3, :3].T + pose[:3, 3], ahead @ pose[:3, :3].T


def cast(corners: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First hits by brute force in double precision (Möller and Trumbore): distance (n,), triangle (n,) or -1."""
    first, one, two = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    distance, triangle = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for t in range(len(corners)):
        across = np.cross(directions, two[t])
        det = across @ one[t]
        with np.errstate(divide="ignore", invalid="ignore"):
            start = origins - first[t]
            u = (start * across).sum(axis=1) / det
            turned = np.cross(start, one[t])
            v = (directions * turned).sum(axis=1) / det
            away = turned @ two[t] / det
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (away > 1e-9) & (away < distance)
        distance[hit], triangle[hit] = away[hit], t
    return distance, triangle
