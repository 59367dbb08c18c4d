"""What the mill itself costs: shards that hold five bytes, committed with fsync and record, on one worker."""

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

SHARDS = 400
FEW = 20


def bench() -> Iterator[Measure]:
    """Shards a second of the mill beside loky alone, which neither syncs nor records; and an idle run's seconds."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        out = Path(folder)
        few, many = (_mill(out / str(count), count) for count in (FEW, SHARDS))
        with ProcessPoolExecutor(max_workers=1) as executor:
            list(executor.map(_salt, [out / f"warm-{index}" for index in range(FEW)]))
            start = time.perf_counter()
            list(executor.map(_salt, [out / f"bag-{index}" for index in range(SHARDS)]))
            peer = SHARDS / (time.perf_counter() - start)
        idle = _mill(out / str(SHARDS), SHARDS)
    rate = (SHARDS - FEW) / (many - few)
    milliseconds = 1000 / rate
    yield Measure(
        "mill: empty shards committed",
        "shards",
        rate,
        "loky, no record, no fsync",
        peer,
        f"{milliseconds:.1f} ms a shard; the first worker starts in {few - FEW / rate:.2f} s",
    )
    yield Measure("mill: finished shards looked over", "shards", SHARDS / idle, note=f"{SHARDS} shards in {idle:.2f} s")


def _mill(out: Path, shards: int) -> float:
    out.mkdir(exist_ok=True)
    config = out / "mill.yaml"
    config.write_text(f"name: mill\nsalt:\n  bags: {shards}\n")
    start = time.perf_counter()
    run_toy_stages(config, out, "salt")
    return time.perf_counter() - start


def _salt(path: Path) -> int:
    return path.write_bytes(b"salt ")
