"""Recovery of known parts from a model that is merged to one mesh and segmented again."""

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
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig, Segmentation, ShapeFile
from stages.points.area_sampling import SurfacePoints, sample_shape
from stages.shape.arrays import IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape

NUM_POINTS = 8192
"""Surface points by which parts are compared."""
CONTACT_DISTANCE_SHARE = 1e-3
"""Between faces in contact, as a share of the diagonal."""
MIN_OVERLAP = 0.5
"""Intersection over union above which a part counts as recovered."""


@dataclass(frozen=True)
class PartRecovery:
    """The recovery of the parts of a model."""

    name: str
    segmentation: str
    parts: tuple[int, int]
    """Known and found."""
    types: tuple[int, int]
    """Known and found."""
    part_index: float
    """Adjusted Rand index of points by part."""
    type_index: float
    """Adjusted Rand index of points by type."""
    recovered: float
    """Share of the parts with a found part of their own."""
    contacts: float
    """Share of the contacts between recovered parts that are found."""
    seconds: float
    """For the segmentation."""
    failure: str = ""
    """Why no parts were found."""


def write_merged(shape: Shape, path: Path) -> None:
    """Write a shape as one mesh, with coincident vertices of its parts welded."""
    vertices, faces, count = [], [], 0
    for kind, pose in zip(shape.assembly.types.tolist(), shape.placements, strict=True):
        mesh = shape.meshes[kind]
        vertices.append(transform_points(pose, mesh.vertices))
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    whole = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
    whole.merge_vertices(merge_norm=True, merge_tex=True)
    whole.export(path)


def measure_part_recovery(name: str, shape: Shape, segmentation: Segmentation) -> PartRecovery:
    """Merge a shape with known parts, segment it, and compare. A failed segmentation has no parts."""
    known = (len(shape.assembly), len(np.unique(shape.assembly.types)))
    start = time.perf_counter()
    try:
        found = _segment_merged(shape, segmentation)
    except ConfigError as error:
        nothing = (known[0], 0), (known[1], 0), 0.0, 0.0, 0.0, 0.0, time.perf_counter() - start
        return PartRecovery(name, segmentation, *nothing, failure=str(error).partition(": ")[2].partition(";")[0])
    seconds = time.perf_counter() - start
    cloud = points_of_parts(shape)
    truth, nearest = cloud.instances.astype(np.int64), _nearest_parts(found, cloud.points)
    matched = _matched(truth, nearest, known[0])
    types = shape.assembly.types[truth].astype(np.int64), found.assembly.types[nearest].astype(np.int64)
    expected = [(matched[i], matched[j]) for i, j in shape.assembly.edges.tolist() if i in matched and j in matched]
    contacts = {(min(pair), max(pair)) for pair in found.assembly.edges.tolist()}
    kept = sum((min(pair), max(pair)) in contacts for pair in expected)
    return PartRecovery(
        name,
        segmentation,
        (known[0], len(found.assembly)),
        (known[1], len(np.unique(found.assembly.types))),
        rand_index(truth, nearest),
        rand_index(*types),
        len(matched) / known[0],
        kept / len(expected) if expected else 0.0,
        seconds,
    )


def _segment_merged(shape: Shape, segmentation: Segmentation) -> Shape:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "merged.glb"
        write_merged(shape, path)
        config = KitConfig(name="merged", shapes=(ShapeFile(path=path),), parts=segmentation, up=shape.up).resolve(
            STRICTEST
        )
        kit = observe_models(config, [read_parts(path, segmentation)]).kit
    return Shape(kit.types, kit.exemplars[0].whole, kit.up, kit.type_names())


def points_of_parts(shape: Shape) -> SurfacePoints:
    """Sample surface points of a shape, without those where two parts touch."""
    cloud = sample_shape(shape, NUM_POINTS, np.random.default_rng(0))
    scene, _ = scene_of_parts(shape)
    reach = CONTACT_DISTANCE_SHARE * float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
    rays = np.concatenate([cloud.points - reach * cloud.normals, cloud.normals], axis=1).astype(np.float32)
    # rays from behind the face hit it once, and a second time a face in contact
    hits = scene.list_intersections(o3d.core.Tensor(rays))
    is_near = hits["t_hit"].numpy() < 2 * reach
    counts = np.bincount(hits["ray_ids"].numpy()[is_near], minlength=len(rays))
    return cloud.take(np.flatnonzero(counts < 2))


def _nearest_parts(shape: Shape, points: np.ndarray) -> IntArray:
    """Return the part of a shape nearest to each point (n, 3), int64 (n,)."""
    scene, part_of = scene_of_parts(shape)
    closest = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
    return np.array([part_of[geometry] for geometry in closest["geometry_ids"].numpy().tolist()], dtype=np.int64)


def scene_of_parts(shape: Shape) -> tuple[o3d.t.geometry.RaycastingScene, dict[int, int]]:
    """Return a scene of the parts of a shape, and the part of each geometry."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    part_of: dict[int, int] = {}
    for part, (kind, pose) in enumerate(zip(shape.assembly.types.tolist(), shape.placements, strict=True)):
        mesh = shape.meshes[kind]
        placed = transform_points(pose, mesh.vertices).astype(np.float32)
        part_of[scene.add_triangles(placed, mesh.faces.astype(np.uint32))] = part
    return scene, part_of


def _matched(truth: np.ndarray, nearest: np.ndarray, parts: int) -> dict[int, int]:
    """Return the found part of each recovered part."""
    counts = np.zeros((parts, int(nearest.max()) + 1))
    np.add.at(counts, (truth, nearest), 1)
    union = counts.sum(axis=1, keepdims=True) + counts.sum(axis=0, keepdims=True) - counts
    share = counts / np.maximum(union, 1)
    best = share.argmax(axis=1)
    return {part: int(best[part]) for part in range(parts) if share[part, best[part]] > MIN_OVERLAP}


def rand_index(first: np.ndarray, second: np.ndarray) -> float:
    """Return the adjusted Rand index (Hubert and Arabie 1985) of two labellings (n,): 1 if equal, about 0 by chance."""
    _, rows = np.unique(first, return_inverse=True)
    _, columns = np.unique(second, return_inverse=True)
    counts = np.zeros((rows.max() + 1, columns.max() + 1))
    np.add.at(counts, (rows, columns), 1)

    def pairs(values: np.ndarray) -> float:
        return float((values * (values - 1) / 2).sum())

    of_rows, of_columns = pairs(counts.sum(axis=1)), pairs(counts.sum(axis=0))
    expected = of_rows * of_columns / max(pairs(np.array([len(first)])), 1.0)
    largest = (of_rows + of_columns) / 2
    return 1.0 if largest == expected else (pairs(counts) - expected) / (largest - expected)


def decomposition_table(shapes: Iterable[tuple[str, Shape]], segmentations: Sequence[Segmentation]) -> Table:
    """Return one row for each shape and segmentation."""
    rows: list[tuple[Cell, ...]] = []
    for name, shape in shapes:
        for segmentation in segmentations:
            recovery = measure_part_recovery(name, shape, segmentation)
            counts = (f"{recovery.parts[0]} / {recovery.parts[1]}", f"{recovery.types[0]} / {recovery.types[1]}")
            shares = (recovery.part_index, recovery.type_index, 100 * recovery.recovered, 100 * recovery.contacts)
            cells: tuple[Cell, ...] = ("", "", "", "") if recovery.failure else shares
            rows.append((name, segmentation, *counts, *cells, recovery.seconds, recovery.failure))
    columns = (
        "model",
        "segmentation",
        "parts",
        "types",
        "parts, Rand",
        "types, Rand",
        "recovered %",
        "contacts %",
        "s",
        "",
    )
    notes = (
        f"Models with known parts, merged to one mesh and welded, then segmented; {NUM_POINTS:,} points of their "
        "surface, "
        "without those where two parts touch. Parts, types: known / found. Rand: adjusted Rand index of the points by "
        "part and by type; 1 for full recovery, 0 by chance. Recovered: parts with a found part of their own, by more "
        "than half intersection over union. Contacts: those between recovered parts that are found.",
    )
    return Table("Recovery of known parts", columns, tuple(rows), notes)
