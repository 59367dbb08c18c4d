"""Draw models with Blender's Cycles; run by a Python that has the package bpy, as `python -m tests.renderings` does.

PYTHON tests/renderings/blender_picture.py JOBS.json
"""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

SAMPLES_PER_PIXEL = 16
LAMP_ENERGY, SKY_LIGHT = 2.2, 0.28
"""A white surface that faces the lamp gives back 0.7 of its light, and 0.28 of that of the sky, as in `views`."""


def main() -> None:
    """Write the pictures of a list of models."""
    for job in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
        _draw(job)
    os._exit(0)  # the package may crash when it unloads


def _draw(job: dict[str, Any]) -> None:
    import bpy
    from mathutils import Matrix

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if job["model"].endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=job["model"])
    else:
        bpy.ops.import_scene.gltf(filepath=job["model"])
    scene, render = bpy.context.scene, bpy.context.scene.render
    # Importers turn the y axis of files up, to Blender's z.
    to_blender = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
    turn = to_blender @ Matrix(job["turn"]) @ to_blender.inverted()
    for item in [item for item in scene.objects if item.parent is None]:
        item.matrix_world = turn @ item.matrix_world
    render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES_PER_PIXEL
    scene.cycles.use_denoising, render.film_transparent = False, True
    render.threads_mode, render.threads = "FIXED", 1
    render.resolution_x, render.resolution_y = job["width"], job["height"]
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("sky")
    scene.world.color = (SKY_LIGHT, SKY_LIGHT, SKY_LIGHT)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = LAMP_ENERGY, math.radians(2.0)
    sun.matrix_world = to_blender @ Matrix(job["lamp"]).to_4x4()
    lens = bpy.data.cameras.new("camera")
    lens.angle, lens.clip_start, lens.clip_end = 2.0 * math.atan(job["slope"]), 1e-4, 1e6
    scene.camera = bpy.data.objects.new("camera", lens)
    scene.camera.matrix_world = to_blender @ Matrix(job["pose"])
    for item in (sun, scene.camera):
        scene.collection.objects.link(item)
    render.filepath = job["file"]
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
