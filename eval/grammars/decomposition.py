"""What comes back of known parts when a model is merged to one mesh and cut again."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh

from eval.engine.table import Cell, Table
from pipeline.errors import ConfigError
from stages.exemplars.build import observe_models
from stages.exemplars.read import read_model
from stages.exemplars.settings import STRICTEST, KitConfig, Segmentation, ShapeFile
from stages.points.area_sampling import SurfacePoints, sample_shape
from stages.shape.arrays import IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape

POINTS = 8192
"""Points of the surface by which parts are compared."""
COVERED = 1e-3
"""Faces that are nearer to each other than this share of the diagonal lie on each other."""
HALF = 0.5
"""A part has come back if it and what was found have more than this share of what both cover in common."""


@dataclass(frozen=True)
class Returned:
    """What came back of a model. parts, types: how many there were and how many were found; part_index, type_index:
    adjusted Rand index of points by part and by type, 1 where all came back; back: share of the parts that have one of
    their own; contacts: share of the contacts between such parts that are contacts of what was found; why: why
    nothing was found, else empty; seconds: for the cut."""

    name: str
    cut: str
    parts: tuple[int, int]
    types: tuple[int, int]
    part_index: float
    type_index: float
    back: float
    contacts: float
    seconds: float
    why: str = ""


def merged(shape: Shape, path: Path) -> None:
    """Write a shape as one mesh: what its parts share, corners that meet, is welded, and nothing tells them apart."""
    vertices, faces, count = [], [], 0
    for kind, pose in zip(shape.assembly.types.tolist(), shape.placements, strict=True):
        mesh = shape.meshes[kind]
        vertices.append(transform_points(pose, mesh.vertices))
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    whole = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
    whole.merge_vertices(merge_norm=True, merge_tex=True)
    whole.export(path)


def returned(name: str, shape: Shape, cut: Segmentation) -> Returned:
    """Merge a shape whose parts are known, cut it, and compare. What no parts can be made of has none."""
    known = (len(shape.assembly), len(np.unique(shape.assembly.types)))
    begun = time.perf_counter()
    try:
        found = _cut(shape, cut)
    except ConfigError as error:
        nothing = (known[0], 0), (known[1], 0), 0.0, 0.0, 0.0, 0.0, time.perf_counter() - begun
        return Returned(name, cut, *nothing, why=str(error).partition(": ")[2].partition(";")[0])
    seconds = time.perf_counter() - begun
    cloud = points_of_parts(shape)
    truth, nearest = cloud.instances.astype(np.int64), _nearest_parts(found, cloud.points)
    matched = _matched(truth, nearest, known[0])
    types = shape.assembly.types[truth].astype(np.int64), found.assembly.types[nearest].astype(np.int64)
    asked = [(matched[i], matched[j]) for i, j in shape.assembly.edges.tolist() if i in matched and j in matched]
    there = {(min(pair), max(pair)) for pair in found.assembly.edges.tolist()}
    kept = sum((min(pair), max(pair)) in there for pair in asked)
    return Returned(
        name,
        cut,
        (known[0], len(found.assembly)),
        (known[1], len(np.unique(found.assembly.types))),
        rand_index(truth, nearest),
        rand_index(*types),
        len(matched) / known[0],
        kept / len(asked) if asked else 0.0,
        seconds,
    )


def _cut(shape: Shape, cut: Segmentation) -> Shape:
    """What Shapemill makes of the merged shape."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "merged.glb"
        merged(shape, path)
        config = KitConfig(name="merged", shapes=(ShapeFile(path=path),), parts=cut, up=shape.up).resolve(STRICTEST)
        kit = observe_models(config, [read_model(path, cut)]).kit
    return Shape(kit.types, kit.exemplars[0].whole, kit.up, kit.type_names())


def points_of_parts(shape: Shape) -> SurfacePoints:
    """Points of the surface of a shape, but for those where two parts meet: each belongs to one part alone."""
    cloud = sample_shape(shape, POINTS, np.random.default_rng(0))
    scene, _ = scene_of_parts(shape)
    reach = COVERED * float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
    rays = np.concatenate([cloud.points - reach * cloud.normals, cloud.normals], axis=1).astype(np.float32)
    # from behind its own face: that is hit once, and again what lies on it
    hits = scene.list_intersections(o3d.core.Tensor(rays))
    near = hits["t_hit"].numpy() < 2 * reach
    counts = np.bincount(hits["ray_ids"].numpy()[near], minlength=len(rays))
    return cloud.take(np.flatnonzero(counts < 2))


def _nearest_parts(shape: Shape, points: np.ndarray) -> IntArray:
    """The part of a shape that is nearest to each point (n, 3), int64 (n,)."""
    scene, part_of = scene_of_parts(shape)
    closest = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
    return np.array([part_of[each] for each in closest["geometry_ids"].numpy().tolist()], dtype=np.int64)


def scene_of_parts(shape: Shape) -> tuple[o3d.t.geometry.RaycastingScene, dict[int, int]]:
    """The parts of a shape to be looked at, and the part of each geometry."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    part_of: dict[int, int] = {}
    for part, (kind, pose) in enumerate(zip(shape.assembly.types.tolist(), shape.placements, strict=True)):
        mesh = shape.meshes[kind]
        placed = transform_points(pose, mesh.vertices).astype(np.float32)
        part_of[scene.add_triangles(placed, mesh.faces.astype(np.uint32))] = part
    return scene, part_of


def _matched(truth: np.ndarray, nearest: np.ndarray, parts: int) -> dict[int, int]:
    """For each part that has come back the part that was found."""
    counts = np.zeros((parts, int(nearest.max()) + 1))
    np.add.at(counts, (truth, nearest), 1)
    union = counts.sum(axis=1, keepdims=True) + counts.sum(axis=0, keepdims=True) - counts
    share = counts / np.maximum(union, 1)
    best = share.argmax(axis=1)
    return {part: int(best[part]) for part in range(parts) if share[part, best[part]] > HALF}


def rand_index(first: np.ndarray, second: np.ndarray) -> float:
    """The adjusted Rand index (Hubert and Arabie 1985) of two labellings (n,) of the same things: 1 where they tell the
    same apart, about 0 for one by chance."""
    _, rows = np.unique(first, return_inverse=True)
    _, columns = np.unique(second, return_inverse=True)
    counts = np.zeros((rows.max() + 1, columns.max() + 1))
    np.add.at(counts, (rows, columns), 1)

    def pairs(values: np.ndarray) -> float:
        return float((values * (values - 1) / 2).sum())

    of_rows, of_columns = pairs(counts.sum(axis=1)), pairs(counts.sum(axis=0))
    expected = of_rows * of_columns / max(pairs(np.array([len(first)])), 1.0)
    most = (of_rows + of_columns) / 2
    return 1.0 if most == expected else (pairs(counts) - expected) / (most - expected)


def decomposition_table(shapes: Iterable[tuple[str, Shape]], cuts: Sequence[Segmentation]) -> Table:
    """A row for each shape and way to cut it."""
    rows: list[tuple[Cell, ...]] = []
    for name, shape in shapes:
        for cut in cuts:
            each = returned(name, shape, cut)
            counts = (f"{each.parts[0]} / {each.parts[1]}", f"{each.types[0]} / {each.types[1]}")
            shares = (100 * each.back, 100 * each.contacts)
            figures: tuple[Cell, ...] = ("", "", "", "") if each.why else (each.part_index, each.type_index, *shares)
            rows.append((name, cut, *counts, *figures, each.seconds, each.why))
    columns = ("model", "cut by", "parts", "types", "parts, Rand", "types, Rand", "parts back %", "contacts %", "s", "")
    notes = (
        f"Models whose parts are known, merged to one mesh and welded, then cut again; {POINTS:,} points of their "
        "surface, but for those where two parts meet. Parts, types: known / found. Rand: adjusted Rand index of the "
        "points by part, and by type; 1 where all came back, 0 by chance. Parts back: those that have a found part of "
        "their own, with more than half of what both cover in common. Contacts: of those between parts that came back, "
        "how many are contacts of what was found.",
    )
    return Table("What comes back of known parts", columns, tuple(rows), notes)
