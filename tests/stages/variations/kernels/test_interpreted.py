"""Compiled searches also run as plain Python."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.stages.variations.kernels.toy_searches import toy_searches


def test_interpreted_searches_find_what_compiled_ones_find() -> None:
    command = [sys.executable, "-W", "ignore", "-m", "tests.stages.variations.kernels.toy_searches"]
    done = subprocess.run(
        command, capture_output=True, text=True, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == toy_searches()
