"""Views a CPU second of Blender's Cycles, for comparison with bench_views; run by a Python that has the package bpy.

PYTHON tests/bench/blender_views.py MODEL.glb

Eevee needs OpenGL, so that Cycles is what renders without a screen: 16 samples a pixel, one thread, no denoiser.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

IMAGE_SIZE, CAMERA_COUNT, SAMPLES_PER_PIXEL = 256, 12, 16
FIELD_OF_VIEW_DEGREES, ELEVATION_DEGREES = 40.0, 20.0


def main() -> None:
    """Print views a CPU second, with depth, normals and object ids rendered along."""
    parser = argparse.ArgumentParser(description="Measure views a CPU second of Blender's Cycles.")
    parser.add_argument("model", type=Path, help="a GLB")
    model = parser.parse_args().model
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(model))
    scene = bpy.context.scene
    meshes = [item for item in scene.objects if item.type == "MESH"]
    triangles = sum(len(item.data.loop_triangles) or len(item.data.polygons) for item in meshes)
    corners = [tuple(item.matrix_world @ vertex.co) for item in meshes for vertex in item.data.vertices]
    low, high = [min(axis) for axis in zip(*corners, strict=True)], [max(axis) for axis in zip(*corners, strict=True)]
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    radius = max(math.dist(corner, middle) for corner in corners)
    _set_up(bpy, scene, radius)
    with TemporaryDirectory() as folder:
        _render(scene, middle, radius, 0, folder)  # builds the acceleration structure
        start = time.process_time()
        for number in range(CAMERA_COUNT):
            _render(scene, middle, radius, number, folder)
        seconds = time.process_time() - start
    version = bpy.app.version_string
    print(f"Blender {version}, Cycles: {CAMERA_COUNT / seconds:.2f} views a CPU second, {triangles:,} triangles")


def _set_up(bpy: Any, scene: Any, radius: float) -> None:
    """Set the renderer, one sun, a grey sky and the camera."""
    render = scene.render
    render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES_PER_PIXEL
    scene.cycles.use_denoising = False
    render.threads_mode, render.threads, render.use_persistent_data = "FIXED", 1, True
    render.resolution_x = render.resolution_y = IMAGE_SIZE
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_object_index = True
    scene.world = bpy.data.worlds.new("sky")
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (math.radians(40), 0.0, math.radians(-50))
    lens = bpy.data.cameras.new("camera")
    lens.angle, lens.clip_start, lens.clip_end = math.radians(FIELD_OF_VIEW_DEGREES), 0.01 * radius, 100.0 * radius
    scene.camera = bpy.data.objects.new("camera", lens)
    for item in (sun, scene.camera):
        scene.collection.objects.link(item)


def _render(scene: Any, middle: list[float], radius: float, number: int, folder: str) -> None:
    """Write the view of one camera of a ring as PNG."""
    import bpy
    from mathutils import Vector

    distance = 1.05 * radius / math.sin(math.radians(FIELD_OF_VIEW_DEGREES / 2))
    azimuth, elevation = 2 * math.pi * number / CAMERA_COUNT, math.radians(ELEVATION_DEGREES)
    across, above = distance * math.cos(elevation), distance * math.sin(elevation)
    offset = Vector((across * math.sin(azimuth), -across * math.cos(azimuth), above))
    scene.camera.location = Vector(middle) + offset
    scene.camera.rotation_euler = (-offset).to_track_quat("-Z", "Y").to_euler()
    scene.render.filepath = str(Path(folder) / f"{number}.png")
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
