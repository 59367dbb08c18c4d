"""Meshes and point clouds from files, each read in a child process with limited time and memory."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.bounded import ChildFailed, in_child
from pipeline.errors import ConfigError
from stages.exemplars.read import read_parts
from stages.grammars.extraction.extract import SurfaceMesh, model_surface
from stages.grammars.scans.scanned_grid import ScannedCloud
from stages.model_files.enclosure import Enclosure
from stages.model_files.limits import ReadLimits
from stages.model_files.ply import read_ply_points
from stages.model_files.scene import GREY

TEXT_COLUMNS = {".xyz": None, ".xyzn": "normals", ".xyzrgb": "colours"}
"""Further columns of clouds as text, one point a line, after x, y, z; colours from 0 to 1, as Open3D writes them."""
IS_MESH = b""
"""Answer of the child process for a PLY file with faces."""


def read_surface(
    path: Path, limits: ReadLimits | None = None
) -> tuple[SurfaceMesh | ScannedCloud, Literal["y", "z"] | None]:
    """Read a model file as one mesh, or a cloud; also return the up axis that the file states.

    Raises ConfigError as `read_parts` and `read_cloud` do.
    """
    cloud = read_cloud(path, limits)
    if cloud is not None:
        return cloud, None
    model = read_parts(path, "components", limits)
    return model_surface(model), model.up


def is_point_cloud(path: Path, limits: ReadLimits | None = None) -> bool:
    """Return whether a file is a point cloud. Raises ConfigError as `read_cloud` does."""
    return path.suffix.lower() in TEXT_COLUMNS or read_cloud(path, limits) is not None


def read_cloud(path: Path, limits: ReadLimits | None = None) -> ScannedCloud | None:
    """Read the cloud in a PLY file without faces, or in a table of numbers; None for any other file.

    Raises ConfigError for a file that cannot be read as such. `scanned_grid` decides which clouds are scans.
    """
    suffix = path.suffix.lower()
    if suffix not in (*TEXT_COLUMNS, ".ply") or not path.is_file():
        return None
    limits = limits or ReadLimits()
    try:
        content = in_child(
            lambda: _packed(path), cpu_seconds=limits.cpu_seconds, memory_mb=limits.memory_mb, refusal=ConfigError
        )
    except ChildFailed as error:
        raise ConfigError(
            f"{path}: cannot be read: {error}; thin the cloud out, or raise exemplars.limits in the config"
        ) from None
    if content == IS_MESH:
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        normals = stored["normals"]
        return ScannedCloud(stored["points"], stored["colors"], normals if len(normals) else None)


def _packed(path: Path) -> bytes:
    """Return a cloud as an npz file of plain arrays; IS_MESH for a file with faces."""
    if path.suffix.lower() == ".ply":
        read = read_ply_points(path, Enclosure(path))
        if read is None:
            return IS_MESH
    else:
        read = _table(path)
    points, normals, colors = read
    if colors is None:
        colors = np.tile(np.array(GREY, np.uint8), (len(points), 1))
    stream = io.BytesIO()
    np.savez(stream, points=points, colors=colors, normals=np.empty((0, 3)) if normals is None else normals)
    return stream.getvalue()


def _table(path: Path) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return points, normals and colours of a text file with one point a line."""
    columns = TEXT_COLUMNS[path.suffix.lower()]
    try:
        rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise ConfigError(f"{path}: no table of numbers ({error}); export it again") from None
    if rows.shape[1] < (6 if columns else 3):
        raise ConfigError(f"{path}: {rows.shape[1]} numbers a line; a point has {'6' if columns else '3'} at least")
    points, last = np.ascontiguousarray(rows[:, :3]), rows[:, 3:6]
    if columns == "colours":
        return points, None, np.rint(np.clip(last, 0, 1) * 255).astype(np.uint8)
    return points, last if columns == "normals" else None, None
