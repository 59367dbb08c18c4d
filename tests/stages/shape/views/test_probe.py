from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from stages.shape.views.probe import probe, probe_in_subprocess

ROOT = Path(__file__).resolve().parents[4]


def run(*words):
    command = [sys.executable, "-m", "stages.shape.views.probe", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)


def test_ray_casting_draws_everywhere():
    assert probe("raycast") is None
    done = run("raycast")
    assert (done.returncode, done.stdout.strip()) == (0, "raycast: draws")


def test_a_backend_that_cannot_draw_says_why_in_one_line():
    done = run("osmesa")
    assert done.returncode in (0, 1)
    assert len(done.stdout.strip().splitlines()) == 1
    assert (done.returncode == 0) == (probe_in_subprocess("osmesa") is None)


def test_an_unknown_backend_is_a_wrong_call():
    done = run("crayons")
    assert done.returncode == 2
    assert "egl|osmesa|raycast" in done.stderr
