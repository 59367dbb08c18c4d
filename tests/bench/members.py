"""What each member of a sample costs: bytes and CPU seconds, by the stage that makes it.

    python -m tests.bench.members OUT [CONFIG]

makes the dataset of a config, by default `everything`, in the empty folder OUT, stage by stage with one worker, and
prints a table. The seconds are those of the run that makes the samples, less those of a run that finds them made.
Kernels that are compiled on the way count: make any dataset with these stages before.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from pipeline.config import load_config
from pipeline.registry import find_stages, upstream
from pipeline.shards import read_shard
from stages.shape.collection.discovery import members
from tests.bench.bench_whole import Dataset, seconds_by_stage

CONFIG = "everything"
BYTES_PER_KB = 1000


def main() -> None:
    """Measure and print the table."""
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    out, dataset = Path(sys.argv[1]), Dataset(sys.argv[2] if len(sys.argv) > 2 else CONFIG, {}, {})
    found = find_stages()
    stages = upstream(found, "package")
    seconds = seconds_by_stage(dataset, {}, out, stages)
    again = seconds_by_stage(dataset, {}, out, stages)
    config = load_config(out.with_suffix(".yaml"), {name: stage.config for name, stage in found.items()})
    sizes, count = _sizes(out / config.name)
    left = dict(sizes)
    print(f"{count} samples, {sum(sizes.values()) / count / BYTES_PER_KB:.0f} kB each\n")
    print("| stage | members | kB a sample | CPU ms a sample |\n|---|---|---:|---:|")
    declared = members()
    for stage in stages:
        names = [member.name for member in declared[stage].of(config)] if stage in declared else []
        names = ["glb", "json"] if stage == "package" else [name for name in names if name in left]
        size = sum(left.pop(name) for name in names) / count / BYTES_PER_KB
        spent = max(0.0, seconds[stage] - again[stage]) / count * 1000
        if names or spent >= 1:
            print(f"| {stage} | {', '.join(f'`{name}`' for name in names)} | {size:.1f} | {spent:.0f} |")


def _sizes(folder: Path) -> tuple[Counter[str], int]:
    """Return the bytes of each member of all samples, and the number of samples."""
    sizes, count = Counter[str](), 0
    for path in sorted(folder.glob("data/*/*.tar")):
        for _, sample in read_shard(path):
            count += 1
            sizes.update({name: len(content) for name, content in sample.items()})
    return sizes, count


if __name__ == "__main__":
    main()
