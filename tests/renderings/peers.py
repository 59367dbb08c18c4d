"""Pictures of a model file by other renderers, from a camera of a record."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray
from stages.shape.shape import Z_TO_Y
from stages.shape.views.opengl import load_pyrender
from stages.shape.views.palette import linear_to_srgb
from stages.views.cameras import orbit_rotation

LAMP_AZIMUTH, LAMP_HEIGHT = -50.0, 0.766
"""Those of the default of `views`: 50 degrees high."""


def camera_pose(camera: Mapping[str, Any]) -> np.ndarray:
    """Return the pose of a camera of a record, with OpenGL's axes, (4, 4)."""
    pose: np.ndarray = np.linalg.inv(np.array(camera["world_to_camera"]))
    pose[:3, 1:3] *= -1.0
    return pose


def pyrender_pictures(path: Path, up: str, camera: Mapping[str, Any]) -> tuple[ByteArray, ByteArray, BoolArray]:
    """Return lit and unlit colours, uint8 (h, w, 3), and where the model is seen, bool (h, w)."""
    import trimesh

    pyrender = load_pyrender()
    loaded = trimesh.load_scene(path, process=False)
    if up == "z":
        loaded.apply_transform(Z_TO_Y)
    scene = pyrender.Scene.from_trimesh_scene(loaded, bg_color=(1.0, 1.0, 1.0, 1.0), ambient_light=np.full(3, 0.35))
    k, size = np.array(camera["intrinsics"]), float(np.ptp(loaded.bounds, axis=0).max())
    lens = pyrender.IntrinsicsCamera(k[0, 0], k[1, 1], k[0, 2], k[1, 2], znear=0.05 * size, zfar=100.0 * size)
    scene.add(lens, pose=camera_pose(camera))
    lamp = np.eye(4)
    lamp[:3, :3] = orbit_rotation(LAMP_AZIMUTH, LAMP_HEIGHT).T
    scene.add(pyrender.DirectionalLight(intensity=2.2), pose=lamp)
    drawer = pyrender.OffscreenRenderer(camera["width"], camera["height"])
    skip = pyrender.RenderFlags.SKIP_CULL_FACES
    lit, depth = drawer.render(scene, flags=skip)
    # Without light, pyrender shows linear factors as if they were sRGB. Of OBJ, trimesh takes `Kd` as factor.
    is_linear = path.suffix.lower() != ".obj"
    for mesh in scene.meshes:
        for primitive in mesh.primitives:
            factor = np.asarray(primitive.material.baseColorFactor, dtype=float)
            shown = linear_to_srgb(factor[:3]) / 255.0 if is_linear else factor[:3]
            primitive.material.baseColorFactor = [*shown, *factor[3:]]
    unlit, _ = drawer.render(scene, flags=skip | pyrender.RenderFlags.FLAT)
    drawer.delete()
    return lit[:, :, :3], unlit[:, :, :3], depth > 0


def blender_pictures(python: Path, jobs: Sequence[Mapping[str, Any]], folder: Path) -> list[ByteArray]:
    """Return lit colours of models by Cycles, uint8 (h, w, 3).

    python: an interpreter that has the package bpy
    jobs: model, up and camera of each picture
    """
    from PIL import Image

    listed, pictures = folder / "blender.json", []
    described = []
    for number, job in enumerate(jobs):
        turn = Z_TO_Y if job["up"] == "z" else np.eye(4)
        camera = job["camera"]
        described.append(
            {
                "model": job["model"],
                "turn": turn.tolist(),
                "pose": camera_pose(camera).tolist(),
                "width": camera["width"],
                "height": camera["height"],
                "slope": camera["width"] / 2 / camera["intrinsics"][0][0],
                "lamp": orbit_rotation(LAMP_AZIMUTH, LAMP_HEIGHT).T.tolist(),
                "file": str((folder / f"cycles{number}.png").resolve()),
            }
        )
    listed.write_text(json.dumps(described), encoding="utf-8")
    script = Path(__file__).with_name("blender_picture.py")
    subprocess.run([str(python), str(script), str(listed)], check=True, stdout=subprocess.DEVNULL)
    for entry in described:
        picture = Image.open(str(entry["file"])).convert("RGBA")
        white = Image.new("RGBA", picture.size, (255, 255, 255, 255))
        pictures.append(np.asarray(Image.alpha_composite(white, picture).convert("RGB")))
    return pictures
