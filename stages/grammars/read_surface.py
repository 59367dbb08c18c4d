"""The surface of a model file or a scan, as grammars take it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from stages.cloud_files.read import read_cloud
from stages.exemplars.read import read_parts
from stages.exemplars.settings import METRES, Units
from stages.grammars.extraction.extract import SurfaceMesh, model_surface
from stages.grammars.scans.scanned_grid import ScannedCloud
from stages.model_files.limits import ReadLimits
from stages.model_files.scene import GREY


def read_surface(
    path: Path, limits: ReadLimits | None = None, units: Units = "auto"
) -> tuple[SurfaceMesh | ScannedCloud, Literal["y", "z"] | None, tuple[str, ...]]:
    """Read a model file as one mesh, or a cloud; also return the up axis that the file states, and warnings.

    units: of the numbers in the file; a surface is in metres if `units` or the file states the unit

    `scanned_grid` decides which clouds are scans. Raises ConfigError as `read_parts` and `read_cloud` do.
    """
    cloud = read_cloud(path, limits)
    if cloud is None:
        model = read_parts(path, "components", limits, units)
        return model_surface(model), model.up, model.warnings
    colors = np.tile(np.array(GREY, np.uint8), (len(cloud.points), 1)) if cloud.colors is None else cloud.colors
    if units == "auto":
        return ScannedCloud(cloud.points, colors, cloud.normals), None, cloud.warnings
    return ScannedCloud(METRES[units] * cloud.points, colors, cloud.normals, "metre"), None, cloud.warnings


def is_point_cloud(path: Path, limits: ReadLimits | None = None) -> bool:
    """Return whether a file is a point cloud. Raises ConfigError as `read_cloud` does."""
    return read_cloud(path, limits) is not None
