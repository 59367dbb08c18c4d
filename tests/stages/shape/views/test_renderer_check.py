from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from stages.shape.views.raster import RasterRenderer
from stages.shape.views.renderer_check import check_triangle

ROOT = Path(__file__).resolve().parents[4]


def run(*words, **environment):
    command = [sys.executable, "-m", "stages.shape.views.renderer_check", *words]
    env = {**os.environ, **environment}
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False, env=env)


def test_the_rasteriser_draws_everywhere():
    fault = check_triangle("raster")
    assert fault is None
    done = run("raster")
    assert (done.returncode, done.stdout.strip()) == (0, RasterRenderer.name)


def test_a_backend_that_cannot_draw_says_why_in_one_line(tmp_path):
    (tmp_path / "pyrender.py").write_text(
        "raise ImportError('libXrender.so.1: cannot open shared object file')\n", encoding="utf-8"
    )
    done = run("egl", PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    assert done.stdout.startswith("no OpenGL context on EGL: ImportError: libXrender.so.1")
    assert len(done.stdout.strip().splitlines()) == 1


def test_an_unknown_backend_is_a_wrong_call():
    done = run("crayons")
    assert done.returncode == 2
    assert "raster|egl" in done.stderr
