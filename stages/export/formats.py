"""A shape as files of other tools, by the name of the format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

from stages.export.mjcf import mjcf_files
from stages.export.model import SimulationModel, simulation_model
from stages.export.obj import obj_files
from stages.export.settings import ExportSettings
from stages.export.urdf import urdf_files
from stages.export.usd import usd_files
from stages.shape.arrays import IntArray
from stages.shape.shape import Shape

ShapeFormat = Literal["urdf", "mjcf", "usd", "obj"]

_SIMULATORS: Mapping[ShapeFormat, Callable[[SimulationModel], Mapping[str, bytes]]] = {
    "urdf": urdf_files,
    "mjcf": mjcf_files,
    "usd": usd_files,
}


def shape_files(
    kind: ShapeFormat, name: str, shape: Shape, connected: IntArray, settings: ExportSettings
) -> Mapping[str, bytes]:
    """Return the files of an upright shape in a format, by their paths below its folder.

    connected: pairs of parts that hold together, int32 (m, 2)

    Raises ValueError for a shape with a part without weight, except as OBJ.
    """
    if kind == "obj":
        return obj_files(name, shape)
    return _SIMULATORS[kind](simulation_model(name, shape, connected, settings))
