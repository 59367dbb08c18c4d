"""Uniform, visible and farthest points per second; peers: trimesh, Open3D and fpsample on the same input."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.points.area_sampling import sample_surface
from stages.points.cloud import farthest_points, sample_cloud
from stages.programs.files import random_shapes
from stages.programs.program import build_shape, find_program
from tests.bench.measure import Measure, rate

UNIFORM_POINTS, SELECTED_POINTS, POOL_POINTS = 2048, 1500, 30_000


def bumpy_sheet(cells: int = 71) -> tuple[np.ndarray, np.ndarray]:
    """A sheet of 2 * cells^2 triangles (10,082 at 71) with hills, so that areas and normals differ."""
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    vertices = np.stack([x, y, 0.2 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    lower = np.stack([corner, corner + cells + 1, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + cells + 1, corner + cells + 2], axis=1)
    return vertices, np.concatenate([lower, upper]).astype(np.int32)


def bench() -> Iterator[Measure]:
    """Clouds per second and core. Peers run by their public functions; trimesh caches areas between calls."""
    import open3d
    import trimesh

    vertices, faces = bumpy_sheet()
    rng = np.random.default_rng(0)
    peer_mesh = trimesh.Trimesh(vertices, faces, process=False)
    open3d_mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices), open3d.utility.Vector3iVector(faces)
    )

    def uniform() -> int:
        return len(sample_surface(vertices, faces, UNIFORM_POINTS, rng)[0]) // UNIFORM_POINTS

    def uniform_trimesh() -> int:
        return len(trimesh.sample.sample_surface(peer_mesh, UNIFORM_POINTS, seed=0)[0]) // UNIFORM_POINTS

    def uniform_open3d() -> int:
        return len(open3d_mesh.sample_points_uniformly(UNIFORM_POINTS).points) // UNIFORM_POINTS

    ours = rate(uniform, seconds=0.5)
    name = f"points, {UNIFORM_POINTS} uniform of {len(faces)} triangles"
    yield Measure(name, "clouds", ours, "trimesh", rate(uniform_trimesh, seconds=0.5))
    yield Measure(name, "clouds", ours, "Open3D", rate(uniform_open3d, seconds=0.5))

    yield from _visible(rng)
    pool = sample_surface(vertices, faces, POOL_POINTS, rng)[0]
    open3d_pool = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(pool))

    def farthest() -> int:
        return len(farthest_points(pool, SELECTED_POINTS, start=0)) // SELECTED_POINTS

    def farthest_open3d() -> int:
        return len(open3d_pool.farthest_point_down_sample(SELECTED_POINTS).points) // SELECTED_POINTS

    ours = rate(farthest, seconds=0.5)
    name = f"points, {SELECTED_POINTS} farthest of {POOL_POINTS}"
    yield Measure(name, "clouds", ours, "Open3D", rate(farthest_open3d, seconds=0.5))
    try:
        import fpsample
    except ImportError:
        yield Measure(name, "clouds", ours, note="no peer fpsample here: it has no wheel, and nothing built it")
        return

    def farthest_fpsample() -> int:
        return len(fpsample.bucket_fps_kdline_sampling(pool, SELECTED_POINTS, h=7, start_idx=0)) // SELECTED_POINTS

    fpsample_rate = rate(farthest_fpsample, seconds=0.5)
    yield Measure(name, "clouds", ours, "fpsample", fpsample_rate, "fpsample ignores the start it is given")


def _visible(rng: np.random.Generator) -> Iterator[Measure]:
    """Clouds of what a scanner sees of ten chairs."""
    chair = find_program("chair")
    shapes = [build_shape(chair, values) for values in random_shapes(chair, 10, 0)]
    for uniform, picked, pool in ((UNIFORM_POINTS, 0, 1), (0, SELECTED_POINTS, POOL_POINTS)):

        def visible(uniform: int = uniform, picked: int = picked, pool: int = pool) -> int:
            return sum(len(sample_cloud(shape, uniform, picked, pool, "visible", rng).points) > 0 for shape in shapes)

        what = f"{uniform} uniform" if uniform else f"{picked} farthest of {pool}"
        yield Measure(f"points, {what}, visible", "clouds", rate(visible, seconds=0.5), note="of random chairs")
