"""The mesh of a sample, projected with nothing but what the record says of the camera, meets the ink of the drawing."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from stages.package.glb import glb_bytes
from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape, upright
from stages.shape.views.camera_record import camera_fields, projected
from stages.shape.views.scene import scene_of
from stages.sketches.draw import draw_sketch, jittered_camera
from stages.sketches.image import augment
from stages.sketches.settings import Augmentation, SketchView, StrokeOptions
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type

IMAGE_PIXELS = 160
MAX_PIXEL_GAP = 1.5
"""Pixels."""
VIEWS = {
    "perspective": SketchView(azimuth=-40.0, elevation=25.0),
    "wide": SketchView(azimuth=115.0, elevation=-20.0, fov=80.0),
    "orthographic": SketchView(azimuth=30.0, elevation=40.0, projection="orthographic"),
    "distant": SketchView(azimuth=70.0, elevation=15.0, distance=5.0, projection="orthographic"),
    "jittered": SketchView(
        azimuth_jitter=180.0, elevation_jitter=40.0, fov_jitter=15.0, distance=4.0, distance_jitter=0.3
    ),
}


def lopsided(up: str) -> Shape:
    """Parts of different sizes far from the origin, none where its mirror image would be; two are turned, none meet:
    where surfaces meet there are lines that no mesh has."""
    kit = kit_of(
        part_type("slab", box((3.0, 0.4, 1.6))),
        part_type("post", box((0.5, 2.0, 0.7))),
        part_type("drum", cylinder(24, 0.5, 0.8)),
        up=up,
    )
    c, s = np.cos(0.4), np.sin(0.4)
    poses = np.tile(np.eye(4), (4, 1, 1))
    offsets = [(0.0, 0.0, 0.0), (1.2, 1.3, 0.3), (-1.0, 0.7, -0.4), (0.2, 1.6, 0.6)]
    poses[:, :3, 3] = np.array(offsets) + np.array([7.0, -2.0, 4.0])
    poses[1, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    poses[3, :3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    return upright(kit_shape(kit, Assembly(np.array([0, 1, 2, 1], np.int16), poses, np.empty((0, 2), np.int32))))


@dataclass(frozen=True)
class Sketch:
    """A drawing, what the record says of its camera, and the mesh file of the shape."""

    pixels: np.ndarray
    camera: dict[str, Any]
    glb: bytes
    thicker: int


@cache
def sketch(view: str, up: str = "y", chances: Augmentation | None = None) -> Sketch:
    shape, rng = lopsided(up), np.random.default_rng(3)
    camera = jittered_camera(VIEWS[view], rng)
    drawing, seen = draw_sketch(scene_of(shape), camera, IMAGE_PIXELS, 2, StrokeOptions(), "raster")
    drawing, flipped, thicker = augment(drawing, chances or Augmentation(), rng)
    fields = {**camera_fields(seen, IMAGE_PIXELS, IMAGE_PIXELS, flipped), "flipped": flipped}
    described = json.loads(json.dumps(fields))
    return Sketch(drawing, described, glb_bytes(shape), thicker)


def pixels_of(points: np.ndarray, camera: dict[str, Any]) -> np.ndarray:
    """Points of the mesh (n, 3) in the picture (n, 2), as a reader of the card would write it."""
    intrinsics, pose = np.array(camera["intrinsics"]), np.array(camera["world_to_camera"])
    x, y, z, _ = pose @ np.column_stack([points, np.ones(len(points))]).T
    if camera["projection"] == "perspective":
        x, y = x / z, y / z
    return (intrinsics @ np.stack([x, y, np.ones_like(x)]))[:2].T


def drawn_edges(glb: bytes, camera: dict[str, Any]) -> np.ndarray:
    """Points along the sharp edges and the outlines of all parts, hidden ones too, in the picture (n, 2)."""
    pose = np.array(camera["world_to_camera"])
    eye, ahead = -pose[:3, :3].T @ pose[:3, 3], pose[2, :3]
    found = []
    for part in trimesh.load(io.BytesIO(glb), file_type="glb").dump():
        part.merge_vertices(merge_tex=True, merge_norm=True)
        towards = part.triangles_center - eye if camera["projection"] == "perspective" else ahead
        facing = (part.face_normals * towards).sum(axis=1) < 0
        pairs = part.face_adjacency
        shown = (part.face_adjacency_angles > np.radians(30)) | (facing[pairs[:, 0]] != facing[pairs[:, 1]])
        ends = part.vertices[part.face_adjacency_edges[shown]]
        found.append((ends[:, :1] + np.linspace(0, 1, 300)[None, :, None] * (ends[:, 1:] - ends[:, :1])).reshape(-1, 3))
    return pixels_of(np.concatenate(found), camera)


def misses(sketch: Sketch, camera: dict[str, Any]) -> list[str]:
    """In what respects the mesh, seen by `camera`, is not what is drawn."""
    rows, columns = np.nonzero(sketch.pixels < 128)
    ink = np.column_stack([columns, rows]) + 0.5
    edges = drawn_edges(sketch.glb, camera)
    if not np.isfinite(edges).all():
        return ["behind the camera"]
    grown = sketch.thicker / 2
    found = []
    strayed = cKDTree(edges).query(ink)[0] > MAX_PIXEL_GAP + grown * np.sqrt(2)  # what is dilated is a square
    if strayed.mean() > 0.002:
        found.append(f"{strayed.mean():.1%} of the ink on no edge")
    hull = edges[ConvexHull(edges).vertices]
    bare = cKDTree(ink).query(hull)[0] > MAX_PIXEL_GAP
    if bare.any():
        found.append(f"{bare.mean():.1%} of the outermost corners without ink")
    boxes = np.stack([edges.min(axis=0), edges.max(axis=0)]), np.stack([ink.min(axis=0), ink.max(axis=0)])
    if np.abs(boxes[0] - boxes[1]).max() > MAX_PIXEL_GAP + grown:
        found.append("another box")
    if np.abs(boxes[0].mean(axis=0) - boxes[1].mean(axis=0)).max() > 0.5:
        found.append("another middle")
    return found


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("view", VIEWS)
def test_the_mesh_seen_by_the_recorded_camera_meets_the_ink(view: str, up: str) -> None:
    drawn = sketch(view, up)
    assert misses(drawn, drawn.camera) == []


@pytest.mark.parametrize("view", ["perspective", "orthographic"])
@pytest.mark.parametrize(
    "chances",
    [Augmentation(flip=1.0), Augmentation(dilate=1.0), Augmentation(flip=1.0, dilate=1.0, size=5)],
    ids=["flip", "dilate", "both"],
)
def test_it_does_so_after_augmentation(view: str, chances: Augmentation) -> None:
    drawn = sketch(view, "z", chances)
    assert drawn.camera["flipped"] == (chances.flip == 1.0)
    assert misses(drawn, drawn.camera) == []


def changed(camera: dict[str, Any], name: str, change: Any) -> dict[str, Any]:
    return {**camera, name: change(np.array(camera[name])).tolist()}


WRONG = {
    "transposed rotation": ("world_to_camera", lambda m: np.block([[m[:3, :3].T, m[:3, 3:]], [m[3:]]])),
    "the inverse": ("world_to_camera", np.linalg.inv),
    "x to the left": ("world_to_camera", lambda m: np.diag([-1, 1, 1, 1]) @ m),
    "y up": ("world_to_camera", lambda m: np.diag([1, -1, 1, 1]) @ m),
    "z backwards": ("world_to_camera", lambda m: np.diag([1, 1, -1, 1]) @ m),
    "z up in the mesh": ("world_to_camera", lambda m: m @ np.eye(4)[[0, 2, 1, 3]]),
    "a pixel to the right": ("intrinsics", lambda k: k + np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0]])),
    "a pixel up": ("intrinsics", lambda k: k - np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])),
    "mirrored": ("intrinsics", lambda k: k * np.array([[-1, 0, 1], [0, 1, 1], [0, 0, 1]])),
    "three hundredths too large": ("intrinsics", lambda k: k * [[1.03, 0, 1], [0, 1.03, 1], [0, 0, 1]]),
    "transposed intrinsics": ("intrinsics", np.transpose),
}


@pytest.mark.parametrize(
    ("view", "wrong"),
    # An orthographic picture does not depend on where z points.
    [("perspective", wrong) for wrong in WRONG]
    + [("orthographic", wrong) for wrong in WRONG if wrong != "z backwards"],
)
def test_a_camera_that_is_a_little_wrong_misses_the_ink(view: str, wrong: str) -> None:
    drawn = sketch(view)
    assert misses(drawn, changed(drawn.camera, *WRONG[wrong]))


def test_other_projection_than_the_recorded_misses_the_ink() -> None:
    drawn = sketch("wide")
    assert misses(drawn, {**drawn.camera, "projection": "orthographic"})


@pytest.mark.parametrize("view", VIEWS)
def test_projected_is_what_the_description_says(view: str) -> None:
    drawn = sketch(view, "z", Augmentation(flip=1.0))
    points = np.random.default_rng(0).normal(size=(50, 3)) * 0.5 + [7.0, 4.0, 2.0]
    np.testing.assert_allclose(projected(drawn.camera, points), pixels_of(points, drawn.camera))


def test_what_is_behind_a_camera_is_not_seen() -> None:
    camera = sketch("perspective").camera
    pose = np.array(camera["world_to_camera"])
    eye, ahead = -pose[:3, :3].T @ pose[:3, 3], pose[2, :3]
    assert np.isnan(projected(camera, (eye - ahead)[None])).all()
    np.testing.assert_allclose(projected(camera, (eye + ahead)[None]), [[IMAGE_PIXELS / 2, IMAGE_PIXELS / 2]])
