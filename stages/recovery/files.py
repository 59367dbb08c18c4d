"""What a recovery leaves behind: parameters, a model, and a picture of the input beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.paths import write_file
from stages.programs.files import shape_glb
from stages.programs.sheets import shape_picture
from stages.recovery.reading import RecoveryInput
from stages.recovery.recover import RecoveryResult
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import points_portrait
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png

CELL = 400
SHOWN = 4096
"""Points of a cloud that a picture shows at most."""


def write_recovery(folder: Path, given: RecoveryInput, found: RecoveryResult) -> list[Path]:
    """`<name>.json`, `<name>.glb` in the program's coordinates, and `<name>.png`."""
    described = json.dumps({"input": given.name, **found.described()}, indent=1, ensure_ascii=False) + "\n"
    return [
        write_file(folder / f"{given.name}.json", described.encode()),
        write_file(folder / f"{given.name}.glb", shape_glb(found.program, found.values)),
        write_file(folder / f"{given.name}.png", picture_png(recovery_picture(given, found))),
    ]


def recovery_picture(given: RecoveryInput, found: RecoveryResult) -> ByteArray:
    """The input beside the shape that was recovered, seen alike; what speaks against it stands below."""
    program = found.program
    camera = found.camera or Camera(azimuth=35.0, elevation=program.view_elevation)
    # the input fills the frame, and so does the shape
    shape = shape_picture(program, found.values, replace(camera, distance=None))
    if given.ink is not None:
        seen = np.where(given.ink, 0, 255).astype(np.uint8)
    else:
        assert given.points is not None
        assert found.placement is not None
        step = max(len(given.points) // SHOWN, 1)
        turned = (given.points[::step] - found.placement[:3, 3]) @ np.linalg.inv(found.placement[:3, :3]).T
        seen = points_portrait(turned, np.zeros(len(turned), np.int32), camera, (CELL, CELL), "y")
    cells = [Cell(seen, given.name), Cell(shape, f"{program.name}, distance {found.distance:.2g}")]
    return contact_sheet([Section("", [cells], "; ".join(found.warnings))], "", CELL)
