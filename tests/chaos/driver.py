"""`make dataset` in one process: `python -m pipeline run` for each stage in order, as long as each ends with 0.

python -m tests.chaos.driver STAGE,STAGE,... [OPTION of `run` ...]
"""

from __future__ import annotations

import sys

from pipeline.cli import main

if __name__ == "__main__":
    stages, *how = sys.argv[1:]
    for stage in stages.split(","):
        sys.argv = ["pipeline", "run", stage, *how]
        try:
            main()
        except SystemExit as end:
            if end.code:
                raise
