"""`shapemill` in this process: its workers are real and stay, and Python starts once, not once for each stage."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout

from pipeline.cli import main
from tests.warm_workers import warm_workers


def shapemill(*arguments: object) -> tuple[int, str]:
    """Return the exit code of `shapemill` with these arguments, and all that it printed."""
    printed, before, code = io.StringIO(), sys.argv, 0
    sys.argv = ["shapemill", *map(str, arguments)]
    try:
        with warm_workers(), redirect_stdout(printed), redirect_stderr(printed):
            main()
    except SystemExit as end:
        code = int(str(end.code or 0))
    finally:
        sys.argv = before
    return code, printed.getvalue()
