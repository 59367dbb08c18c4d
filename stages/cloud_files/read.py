"""Read point clouds, each in a child process with limits: whatever takes a cloud reads it here."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.cloud_files.array_file import read_array_file
from stages.cloud_files.cloud import PointCloud, pack_cloud, unpack_cloud
from stages.cloud_files.number_table import InvalidTable, read_number_table
from stages.cloud_files.point_columns import cloud_of_table, named_columns
from stages.cloud_files.ptx import read_ptx
from stages.model_files.enclosure import Enclosure
from stages.model_files.limits import ReadLimits
from stages.model_files.ply import read_ply_points
from stages.model_files.read import read_bounded
from stages.shape.input_file import check_input_file, decode_text

TABLE_SUFFIXES = (".xyz", ".xyzn", ".xyzrgb", ".txt", ".csv", ".tsv", ".asc", ".pts")
CLOUD_SUFFIXES = (*TABLE_SUFFIXES, ".npy", ".npz", ".pcd", ".ptx", ".ply")
"""Endings of clouds; a PLY file may be a mesh."""
UNREAD_SUFFIXES = {
    ".las": "LAS",
    ".laz": "LAZ",
    ".e57": "E57",
    ".rcp": "ReCap",
    ".rcs": "ReCap",
    ".fls": "Faro",
    ".h5": "HDF5",
    ".hdf5": "HDF5",
    ".mat": "MATLAB",
    ".xlsx": "Excel",
    ".xls": "Excel",
    ".ods": "OpenDocument",
    ".parquet": "Parquet",
}
"""Formats of clouds and tables that are not read."""

IS_MESH = b""
"""Answer of the child process for a PLY or OBJ file with faces."""
_HAS_FACES = re.compile(r"^\s*(f|fo|l|p|curv|surf)\s", re.MULTILINE)


def read_cloud(path: Path, limits: ReadLimits | None = None) -> PointCloud | None:
    """Return the cloud in a file; None for a model file with faces, and for endings that are no cloud's.

    Formats: tables as text, with any delimiter and header, NumPy arrays, PCD, PTX, PLY and OBJ without faces. Points
    that are not finite are left out and counted in a warning. Raises ConfigError, with file, line and remedy.
    """
    suffix = path.suffix.lower()
    if suffix in UNREAD_SUFFIXES:
        raise ConfigError(f"{path}: {UNREAD_SUFFIXES[suffix]} files are not read; {unread_remedy(suffix)}")
    if suffix not in (*CLOUD_SUFFIXES, ".obj"):
        return None
    check_input_file(path, packed="zip" if suffix == ".npz" else "")
    limits = limits or ReadLimits()

    def read() -> bytes:
        cloud = _parse_cloud(path, suffix)
        return IS_MESH if cloud is None else pack_cloud(cloud)

    content = read_bounded(path, read, limits)
    return None if content == IS_MESH else unpack_cloud(content)


def unread_remedy(suffix: str) -> str:
    """Say how a file of UNREAD_SUFFIXES becomes one that is read."""
    if suffix in (".xlsx", ".xls", ".ods"):
        return "save the sheet as CSV"
    if suffix in (".h5", ".hdf5", ".mat", ".parquet"):
        return "save the points with numpy.save"
    return "save the cloud as PLY with CloudCompare, or with `pdal translate` for LAS, LAZ and E57"


def _parse_cloud(path: Path, suffix: str) -> PointCloud | None:
    """Return the cloud in a file, in the calling process; None for a mesh. Raises ConfigError."""
    try:
        if suffix == ".ply":
            read = read_ply_points(path, Enclosure(path))
            cloud = None if read is None else PointCloud(*read)
        elif suffix == ".pcd":
            cloud = _read_pcd(path)
        else:
            cloud = _parse_content(path.read_bytes(), suffix)
    except InvalidTable as error:
        raise ConfigError(f"{path}: {error}") from None
    if cloud is None:
        return None
    cloud = cloud.finite()
    if not len(cloud.points):
        reasons = f" ({'; '.join(cloud.warnings)})" if cloud.warnings else ""
        raise ConfigError(f"{path}: holds no points{reasons}; export it again")
    return cloud


def _parse_content(content: bytes, suffix: str) -> PointCloud | None:
    if suffix in (".npy", ".npz"):
        return read_array_file(content, suffix)
    if suffix == ".ptx":
        return read_ptx(content)
    if suffix == ".obj":
        return _read_obj_points(decode_text(content))
    return cloud_of_table(read_number_table(content, named_columns), suffix)


def _read_obj_points(text: str) -> PointCloud | None:
    """Return the vertices of an OBJ file without faces, lines and curves."""
    if _HAS_FACES.search(text):
        return None
    rows = [line.strip()[1:] if line.split(maxsplit=1)[:1] == ["v"] else "" for line in text.splitlines()]
    return cloud_of_table(read_number_table("\n".join(rows).encode(), named_columns), ".obj") if any(rows) else None


def _read_pcd(path: Path) -> PointCloud:
    """Return the cloud in a PCD file; Open3D says nothing about a file that it cannot read, and returns no points."""
    import open3d as o3d

    read = o3d.io.read_point_cloud(str(path), format="pcd")
    points = np.asarray(read.points, dtype=np.float64)
    announced = re.search(rb"^POINTS\s+(\d{1,18})\s*$", path.read_bytes()[:4096], re.MULTILINE)
    if announced is None or len(points) != int(announced[1]):
        count = "no number of" if announced is None else f"{int(announced[1]):,}"
        raise InvalidTable(f"announces {count} points and {len(points):,} can be read; copy or export it again")
    colors = np.rint(np.asarray(read.colors) * 255).astype(np.uint8) if read.has_colors() else None
    return PointCloud(points, np.asarray(read.normals, dtype=np.float64) if read.has_normals() else None, colors)
