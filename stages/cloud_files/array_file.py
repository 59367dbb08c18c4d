"""Clouds in NumPy files: an array of rows, an array with field names, or the array of points of an archive."""

from __future__ import annotations

import io

import numpy as np

from stages.cloud_files.cloud import PointCloud, color_bytes_of
from stages.cloud_files.number_table import InvalidTable, NumberTable
from stages.cloud_files.point_columns import cloud_of_table, named_columns

POINT_NAMES = ("points", "xyz", "pos", "positions", "position", "vertices", "verts", "coords", "coordinates", "cloud")
NORMAL_NAMES = ("normals", "normal", "n", "vn")
COLOR_NAMES = ("colors", "colours", "color", "colour", "rgb")
MAX_NAMES_SHOWN = 8


def read_array_file(content: bytes, suffix: str) -> PointCloud:
    """Return the cloud in a `.npy` or `.npz` file. Raises InvalidTable for other contents."""
    try:
        loaded = np.load(io.BytesIO(content), allow_pickle=False)
        arrays = {"": loaded} if isinstance(loaded, np.ndarray) else {name: loaded[name] for name in loaded.files}
    except MemoryError:
        raise
    except Exception:  # such as a header that claims too much memory, or is no Python literal
        raise InvalidTable("is no whole NumPy array of numbers; save it again") from None
    name = _points_name(arrays)
    cloud = _cloud(arrays[name], suffix)
    normals = _companion(arrays, NORMAL_NAMES, len(cloud.points)) if name else None
    colors = _companion(arrays, COLOR_NAMES, len(cloud.points)) if name else None
    return PointCloud(
        cloud.points,
        cloud.normals if normals is None else normals.astype(np.float64),
        cloud.colors if colors is None else _bytes(colors),
        cloud.warnings,
    )


def _points_name(arrays: dict[str, np.ndarray]) -> str:
    """Return the name of the array of points: by its name, else the only one of that shape."""
    lowered = {name.lower(): name for name in reversed(arrays)}
    named = next((lowered[name] for name in POINT_NAMES if name in lowered), None)
    if named is not None:
        return named
    shaped = [name for name, array in arrays.items() if array.dtype.names or (array.ndim == 2 and array.shape[1] >= 3)]
    if len(shaped) == 1 or "" in arrays:
        return shaped[0] if shaped else ""
    shown = ", ".join(list(arrays)[:MAX_NAMES_SHOWN]) or "none"
    raise InvalidTable(f"holds the arrays {shown}, and none or several may be points; name one `points`")


def _cloud(array: np.ndarray, suffix: str) -> PointCloud:
    if array.dtype.names:
        columns = named_columns(array.dtype.names)
        if not columns or array.ndim != 1:
            raise InvalidTable(f"has the fields {', '.join(array.dtype.names)}; name the coordinates x, y and z")
        names = tuple(array.dtype.names[column] for column in columns)
        rows = np.stack([_numbers(array[name]) for name in names], axis=1)
        return cloud_of_table(NumberTable(rows, columns, names, len(array.dtype.names), ()), suffix)
    while array.ndim > 2 and array.shape[0] == 1:
        array = array[0]
    if array.ndim != 2 or array.shape[1] < 3:
        turned = "; transpose it" if array.ndim == 2 and array.shape[0] == 3 else ""
        raise InvalidTable(f"is of shape {array.shape}: a cloud is (points, 3){turned}")
    rows = _numbers(array)
    return cloud_of_table(NumberTable(rows, tuple(range(rows.shape[1])), (), rows.shape[1], ()), suffix)


def _numbers(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "fiu":
        raise InvalidTable(f"holds {array.dtype}, no numbers; save the points as floats")
    return array.astype(np.float64)


def _companion(arrays: dict[str, np.ndarray], names: tuple[str, ...], count: int) -> np.ndarray | None:
    for name, array in arrays.items():
        if name.lower() in names and array.shape[:1] == (count,) and array.ndim == 2 and array.shape[1] >= 3:
            return array[:, :3] if array.dtype.kind in "fiu" else None
    return None


def _bytes(colors: np.ndarray) -> np.ndarray:
    return colors if colors.dtype == np.uint8 else color_bytes_of(colors)
