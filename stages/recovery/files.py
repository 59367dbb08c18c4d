"""The files of a recovery: parameters, a model, and a picture of the input next to it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.paths import write_file
from stages.programs.files import shape_glb
from stages.programs.sheets import VIEW_AZIMUTH, shape_picture
from stages.recovery.inputs import RecoveryInput
from stages.recovery.result import RecoveryResult
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import points_portrait
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png

PICTURE_SIDE_PIXELS = 400
MAX_POINTS_SHOWN = 4096


def write_recovery(folder: Path, source: RecoveryInput, result: RecoveryResult) -> list[Path]:
    """Write `<name>.json`, `<name>.glb` and `<name>.png`.

    The GLB of a cloud or a mesh is in the coordinates of the input, with its size and up axis. That of a drawing is in
    the program's.
    """
    text = json.dumps({"input": source.name, **result.as_json()}, indent=1, ensure_ascii=False) + "\n"
    return [
        write_file(folder / f"{source.name}.json", text.encode()),
        write_file(folder / f"{source.name}.glb", shape_glb(result.program, result.values, result.placement)),
        write_file(folder / f"{source.name}.png", picture_png(recovery_picture(source, result))),
    ]


def recovery_picture(source: RecoveryInput, result: RecoveryResult) -> ByteArray:
    """Draw the input next to the recovered shape from the same direction, with the warnings below."""
    program = result.program
    camera = result.camera or Camera(azimuth=VIEW_AZIMUTH, elevation=program.view_elevation)
    # both fill the frame
    shape = shape_picture(program, result.values, replace(camera, distance=None))
    if source.ink is not None:
        picture = np.where(source.ink, 0, 255).astype(np.uint8)
    else:
        assert source.points is not None
        assert result.placement is not None
        step = max(len(source.points) // MAX_POINTS_SHOWN, 1)
        turned = (source.points[::step] - result.placement[:3, 3]) @ np.linalg.inv(result.placement[:3, :3]).T
        size = (PICTURE_SIDE_PIXELS, PICTURE_SIDE_PIXELS)
        picture = points_portrait(turned, np.zeros(len(turned), np.int32), camera, size, "y")
    cells = [Cell(picture, source.name), Cell(shape, f"{program.name}, distance {result.distance:.2g}")]
    return contact_sheet([Section("", [cells], "; ".join(result.warnings))], "", PICTURE_SIDE_PIXELS)
