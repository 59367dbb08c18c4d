"""Does a backend draw here? `python -m stages.shape.views.probe egl|osmesa|raycast` renders and checks one triangle."""

from __future__ import annotations

import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.errors import ShardFailed
from stages.shape.views.buffers import Backend, render_buffers
from stages.shape.views.camera import Camera
from stages.shape.views.scene import mesh_scene

__all__ = ["BACKENDS", "backend_for", "probe", "probe_in_subprocess"]

BACKENDS: tuple[Backend, ...] = ("egl", "osmesa", "raycast")

SECONDS = 120.0


def backend_for(choice: Literal["auto", "egl", "osmesa", "raycast"]) -> Backend:
    """The backend that `auto` stands for on this machine: OpenGL on EGL where a probe in a process of its own draws
    its triangle, else ray casting. Any other choice is taken at its word."""
    return _probed() if choice == "auto" else choice


@lru_cache(maxsize=1)
def _probed() -> Backend:
    return "egl" if probe_in_subprocess("egl") is None else "raycast"


def probe(backend: Backend) -> str | None:
    """Render a triangle with `backend` in this process; None if it is right, else what is wrong."""
    vertices = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]])
    red = np.array([[200, 30, 20]], dtype=np.uint8)
    scene = mesh_scene(vertices, np.array([[0, 1, 2]], dtype=np.int32), red, "y")
    try:
        buffers = render_buffers(scene, Camera(0.0, 0.0, "orthographic", margin=0.0), (32, 32), 1, backend)
    except (ShardFailed, ImportError, OSError) as error:
        return str(error)
    inside = np.tri(32, dtype=bool, k=-1)
    outside = np.tri(32, dtype=bool, k=-1).T
    if not (buffers.color[inside] == red[0]).all() or not (buffers.part[inside] == 0).all():
        return "pixels inside the triangle are not drawn"
    if not np.isinf(buffers.depth[outside]).all():
        return "pixels outside the triangle are drawn"
    return None


def probe_in_subprocess(backend: Backend) -> str | None:
    """`probe` in a process of its own, so that a driver that crashes or hangs takes nothing with it."""
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-m", "stages.shape.views.probe", backend]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, cwd=root, check=False)
    except subprocess.TimeoutExpired:
        return f"no picture within {SECONDS:.0f} seconds"
    if done.returncode == 0:
        return None
    lines = (done.stdout + done.stderr).strip().splitlines()
    return lines[-1] if lines else f"the process ended with code {done.returncode}"


def main() -> int:
    """Entry point: prints one line; 0 if the backend draws, 1 if it does not, 2 for a wrong call."""
    if len(sys.argv) != 2 or sys.argv[1] not in BACKENDS:
        print(f"usage: python -m stages.shape.views.probe {'|'.join(BACKENDS)}", file=sys.stderr)
        return 2
    backend = BACKENDS[BACKENDS.index(sys.argv[1])]
    wrong = probe(backend)
    print(f"{backend}: {'draws' if wrong is None else wrong}")
    return 0 if wrong is None else 1


if __name__ == "__main__":
    sys.exit(main())
