"""A point cloud as read from a file, and its serialization out of the process that read the file."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, FloatArray


@dataclass(frozen=True)
class PointCloud:
    """A point cloud.

    points: float64 (n, 3)
    normals: float64 (n, 3), None if the file has none
    colors: uint8 (n, 3) sRGB, None if the file has none
    warnings: a sentence each: what was taken for what, and what was left out
    """

    points: FloatArray
    normals: FloatArray | None = None
    colors: ByteArray | None = None
    warnings: tuple[str, ...] = ()

    def finite(self) -> PointCloud:
        """Return the cloud without points that are not finite; a warning counts them."""
        good: BoolArray = np.asarray(np.isfinite(self.points).all(axis=1))
        left_out = len(good) - int(good.sum())
        if not left_out:
            return self
        sentence = f"{left_out:,} of {len(good):,} points are not finite (NaN or infinity, or a field is empty)"
        return replace(
            self,
            points=self.points[good],
            normals=None if self.normals is None else self.normals[good],
            colors=None if self.colors is None else self.colors[good],
            warnings=(*self.warnings, f"{sentence} and were left out"),
        )


def color_bytes_of(colors: np.ndarray) -> ByteArray:
    """Return colours (n, 3) as sRGB bytes; the highest value says whether they reach to 1, 255 or 65535."""
    values = np.nan_to_num(np.asarray(colors, dtype=np.float64))
    highest = float(values.max(initial=0.0))
    scale = 255.0 if highest <= 1.0 else 1.0 if highest <= 255.0 else 255.0 / 65535.0
    return np.rint(np.clip(values * scale, 0.0, 255.0)).astype(np.uint8)


def pack_cloud(cloud: PointCloud) -> bytes:
    """Return a cloud as an npz file of plain arrays, which `unpack_cloud` reads."""
    arrays: dict[str, Any] = {"points": cloud.points, "normals": cloud.normals, "colors": cloud.colors}
    arrays["warnings"] = np.frombuffer(json.dumps(cloud.warnings).encode(), np.uint8)
    stream = io.BytesIO()
    np.savez(stream, **{name: array for name, array in arrays.items() if array is not None})
    return stream.getvalue()


def unpack_cloud(content: bytes) -> PointCloud:
    """Return the cloud that `pack_cloud` has packed."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        return PointCloud(
            stored["points"],
            stored.get("normals"),
            stored.get("colors"),
            tuple(json.loads(stored["warnings"].tobytes())),
        )
