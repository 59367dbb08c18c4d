"""Measure how far the views of a dataset agree with its meshes and its points.

python -m tests.renderings.agreement DATASET
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from stages.package.dataset_sample import DatasetSample
from stages.package.reader import Dataset
from stages.shape.views.camera_record import projected

MAX_DEPTH_DIFFERENCE = 5e-3
"""A point is seen where it is no farther than this behind the depth of its pixel, in lengths of the shape."""


def main() -> None:
    """Print the distances of points from depth to the mesh, and the share of seen points with their part's number."""
    parser = argparse.ArgumentParser(prog="python -m tests.renderings.agreement", description="Check views.")
    parser.add_argument("dataset", type=Path)
    means, farthest, same, compared, views = [], [], 0, 0, 0
    for sample in Dataset.open(parser.parse_args().dataset).samples():
        views += len(sample.views)
        mean, largest = _distances(sample)
        means.append(mean)
        farthest.append(largest)
        agreeing, seen = _agreeing(sample)
        same, compared = same + agreeing, compared + seen
    print(f"{len(means)} samples, {views} views")
    print(f"points from depth to the mesh, in lengths of the shape: mean {np.mean(means):.1e}, max {max(farthest):.1e}")
    print(f"points seen by a camera whose part is that of the pixel: {same:,} of {compared:,}, {same / compared:.3%}")


def _distances(sample: DatasetSample) -> tuple[float, float]:
    """Return mean and largest distance of the points of all views to the mesh, in lengths of the shape."""
    import open3d as o3d

    corners = np.concatenate([mesh.triangles for mesh in sample.mesh.dump()]).astype(np.float32)
    caster = o3d.t.geometry.RaycastingScene(nthreads=1)
    numbers = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
    caster.add_triangles(o3d.core.Tensor(corners.reshape(-1, 3)), o3d.core.Tensor(numbers))
    points = np.concatenate([view.points for view in sample.views]).astype(np.float32)
    distances = caster.compute_distance(o3d.core.Tensor(points), nthreads=1).numpy() / _length(sample)
    return float(distances.mean()), float(distances.max())


def _agreeing(sample: DatasetSample) -> tuple[int, int]:
    """Return how many points of the sample's cloud a camera sees, with their part in its pixel, and how many in all.

    Pixels next to another part or to the background are left out.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    points, instances = sample.points.astype(np.float64), sample.instances.astype(np.int64)
    agreeing, seen = 0, 0
    for view in sample.views:
        rotation = np.array(view.camera["world_to_camera"])
        depth = points @ rotation[2, :3] + rotation[2, 3]
        columns, rows = np.floor(projected(view.camera, points)).astype(int).T
        height, width = view.depth.shape
        inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
        columns, rows = np.where(inside, columns, 0), np.where(inside, rows, 0)
        inner = (maximum_filter(view.instances, 3) == minimum_filter(view.instances, 3)) & (view.instances >= 0)
        near = np.abs(view.depth[rows, columns] - depth) <= MAX_DEPTH_DIFFERENCE * _length(sample)
        visible = inside & inner[rows, columns] & near
        agreeing += int((view.instances[rows, columns] == instances)[visible].sum())
        seen += int(visible.sum())
    return agreeing, seen


def _length(sample: DatasetSample) -> float:
    return float(np.ptp(sample.mesh.bounds, axis=0).max())


if __name__ == "__main__":
    main()
