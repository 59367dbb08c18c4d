"""A cluster on this machine, for trying it out and for tests: a scheduler and its workers, each a process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from pipeline.package_groups import require_group
from pipeline.termination import die_with_parent, exit_on_signals

_ENVIRONMENT = {
    # The engine counts deaths by shard; the scheduler's own count blames every task of a dead worker.
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1000000",
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "warning",
}


def serve_cluster(workers: int, port: int) -> int:
    """Run a scheduler on a port of this machine, and workers of one thread each, until a signal ends them.

    Returns the exit code: 1 where the scheduler ended by itself. Raises ConfigError where Dask is not installed.
    """
    require_group("cluster")
    address = f"tcp://127.0.0.1:{port}"
    with exit_on_signals(), tempfile.TemporaryDirectory(prefix="shapemill-cluster-") as folder:
        quiet = ["--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
        scheduler = _start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), *quiet)
        single = ["--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--local-directory", folder]
        started = [scheduler]
        try:
            started += [_start("distributed.cli.dask_worker", address, *single, *quiet) for _ in range(workers)]
            print(f"a scheduler and {workers} workers: make dataset CLUSTER={address}", flush=True)
            while scheduler.poll() is None:
                time.sleep(0.2)
            print(f"the scheduler has ended with {scheduler.returncode}", file=sys.stderr)
            return 1
        finally:
            for process in reversed(started):
                process.kill()
                process.wait()


def _start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments], env={**os.environ, **_ENVIRONMENT}, preexec_fn=die_with_parent
    )
