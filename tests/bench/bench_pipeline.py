"""The overhead of the pipeline: shards of five bytes, committed with fsync and record, on one worker."""

from __future__ import annotations

import contextlib
import io
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from joblib.externals.loky.process_executor import ProcessPoolExecutor

from tests.bench.measure import Measure
from tests.pipeline.toy_run import run_toy_stages

MANY_SHARDS = 400
FEW_SHARDS = 20


def bench() -> Iterator[Measure]:
    """Shards per second, compared with loky without fsync and records; then the seconds of an idle run."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        out = Path(folder)
        few, many = (_run_shards(out / str(count), count) for count in (FEW_SHARDS, MANY_SHARDS))
        with ProcessPoolExecutor(max_workers=1) as executor:
            list(executor.map(_salt, [out / f"warm-{index}" for index in range(FEW_SHARDS)]))
            start = time.perf_counter()
            list(executor.map(_salt, [out / f"bag-{index}" for index in range(MANY_SHARDS)]))
            peer = MANY_SHARDS / (time.perf_counter() - start)
        idle = _run_shards(out / str(MANY_SHARDS), MANY_SHARDS)
    rate = (MANY_SHARDS - FEW_SHARDS) / (many - few)
    milliseconds = 1000 / rate
    yield Measure(
        "pipeline: empty shards committed",
        "shards",
        rate,
        "loky, no record, no fsync",
        peer,
        f"{milliseconds:.1f} ms per shard; the first worker starts in {few - FEW_SHARDS / rate:.2f} s",
    )
    yield Measure(
        "pipeline: finished shards checked", "shards", MANY_SHARDS / idle, note=f"{MANY_SHARDS} shards in {idle:.2f} s"
    )


def _run_shards(out: Path, shards: int) -> float:
    out.mkdir(exist_ok=True)
    config = out / "pipeline.yaml"
    config.write_text(f"name: pipeline\nsalt:\n  bags: {shards}\n", encoding="utf-8")
    start = time.perf_counter()
    run_toy_stages(config, out, "salt")
    return time.perf_counter() - start


def _salt(path: Path) -> int:
    return path.write_bytes(b"salt ")
