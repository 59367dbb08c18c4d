"""Check a renderer: `python -m stages.shape.views.renderer_check raster|egl` renders and checks one triangle."""

from __future__ import annotations

import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from typing import get_args

import numpy as np

from pipeline.errors import ConfigError, ShardFailed
from stages.shape.views.buffers import RendererName, render_buffers, renderer_version
from stages.shape.views.camera import Camera
from stages.shape.views.scene import mesh_scene

RENDERERS: tuple[RendererName, ...] = get_args(RendererName)

CHECK_SECONDS = 120.0


def check_renderer(renderer: RendererName, key: str) -> None:
    """Raise ConfigError, with the remedy, if a renderer cannot draw on this machine.

    key: config key that asks for it

    Our own rasteriser needs only numba, so it is not tried.
    """
    wrong = None if renderer == "raster" else check_in_subprocess(renderer)
    if wrong is not None:
        raise ConfigError(
            f"{key}: {renderer} cannot draw on this machine: {wrong}; `make doctor` says what is missing, and "
            "raster draws everywhere, with a few other pixels"
        )


def check_triangle(renderer: RendererName) -> str | None:
    """Render a triangle in this process. Returns None if it is right, else what is wrong."""
    vertices = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]])
    red = np.array([[200, 30, 20]], dtype=np.uint8)
    scene = mesh_scene(vertices, np.array([[0, 1, 2]], dtype=np.int32), red, "y")
    try:
        buffers = render_buffers(scene, Camera(0.0, 0.0, "orthographic", margin=0.0), (32, 32), 1, renderer)
    except (ShardFailed, ImportError, OSError) as error:
        return str(error)
    inside = np.tri(32, dtype=bool, k=-1)
    outside = np.tri(32, dtype=bool, k=-1).T
    if not (buffers.color[inside] == red[0]).all() or not (buffers.part[inside] == 0).all():
        return "pixels inside the triangle are not drawn"
    if not np.isinf(buffers.depth[outside]).all():
        return "pixels outside the triangle are drawn"
    return None


@lru_cache(maxsize=len(RENDERERS))
def check_in_subprocess(renderer: RendererName) -> str | None:
    """Run `check_triangle` in a process of its own, so that a driver that crashes or hangs does no harm."""
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-m", "stages.shape.views.renderer_check", renderer]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=CHECK_SECONDS, cwd=root, check=False)
    except subprocess.TimeoutExpired:
        return f"no picture within {CHECK_SECONDS:.0f} seconds"
    if done.returncode == 0:
        return None
    lines = (done.stdout + done.stderr).strip().splitlines()
    return lines[-1] if lines else f"the process ended with code {done.returncode}"


def main() -> int:
    """Print the renderer's version or the fault. Returns 0 if it draws, 1 if not, 2 for a wrong call."""
    if len(sys.argv) != 2 or sys.argv[1] not in RENDERERS:
        print(f"usage: python -m stages.shape.views.renderer_check {'|'.join(RENDERERS)}", file=sys.stderr)
        return 2
    renderer = RENDERERS[RENDERERS.index(sys.argv[1])]
    wrong = check_triangle(renderer)
    print(renderer_version(renderer) if wrong is None else wrong)
    return 0 if wrong is None else 1


if __name__ == "__main__":
    sys.exit(main())
