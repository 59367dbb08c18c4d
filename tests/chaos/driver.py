"""`make dataset` in one process: `python -m pipeline run` for each stage in order, as long as each ends with 0.

python -m tests.chaos.driver STAGE=CONFIG,STAGE=CONFIG,... [OPTION of `run` ...]
"""

from __future__ import annotations

import sys

from pipeline.cli import main

if __name__ == "__main__":
    steps, *how = sys.argv[1:]
    for step in steps.split(","):
        stage, _, config = step.partition("=")
        sys.argv = ["pipeline", "run", stage, "--config", config, *how]
        try:
            main()
        except SystemExit as end:
            if end.code:
                raise
