"""`make verify`: is a finished dataset what it says it is?

    python -m pipeline verify --config configs/castle.yaml --out datasets
    python -m stages.verification.verify datasets/castle

Files: checksums, listings, index, splits, foreign and missing files. Every sample: members, arrays, record, mesh and
points against what its record says it is, and against what the stages made, where the mill's folder is still there.
Some samples, chosen at random: contacts, grammar, penetration, statics and drawings by other means than they were made.
Exit code 1, with names, for any fault.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.randomness import decision_rng
from pipeline.yaml_loader import read_yaml
from stages.package.layout import MANIFEST
from stages.verification.files import (
    ClassCounts,
    SampleRow,
    check_classes,
    check_files,
    check_index,
    check_splits,
    read_schema,
)
from stages.verification.findings import Findings
from stages.verification.shard import check_shard


def main(argv: Sequence[str]) -> int:
    """Verify the dataset that `argv` names, by its folder or by config and output folder; print a table; return the
    exit code."""
    arguments = _arguments(argv)
    folder = arguments.folder or arguments.out / str(read_yaml(arguments.config)[0]["name"])
    if not (folder / MANIFEST).is_file():
        print(f"{folder}: no dataset: it has no {MANIFEST}. Make one with: make dataset")
        return 1
    findings = verify_dataset(folder, arguments.samples, arguments.seed, arguments.workers)
    print("\n".join([str(folder), *findings.lines()]))
    return 1 if findings.faults else 0


def verify_dataset(folder: Path, samples: int | None, seed: int, workers: int = 1) -> Findings:
    """Look at the dataset in `folder`; at `samples` of its samples, or all for None, by all means. Never raises for
    what it finds in the files."""
    findings = Findings()
    known = check_files(folder, findings)
    if known is None:
        return findings
    manifest, whole = known
    total = int(manifest["samples"])
    chosen = range(total)
    if samples is not None and samples < total:
        chosen = np.sort(decision_rng(seed, "verify").choice(total, size=samples, replace=False)).tolist()
    index = check_index(folder, manifest, findings)
    schema = read_schema(folder, findings)
    work, first = [], 0
    for shard in manifest["shards"]:
        if shard["path"] in whole:
            anew = {each - first for each in chosen if first <= each < first + shard["samples"]}
            work.append((folder, shard, manifest, schema, index, anew))
        first += shard["samples"]
    rows: list[SampleRow] = []
    tally: ClassCounts = ClassCounts()
    for found, of_shard, of_classes in _side_by_side(work, workers):
        findings.add(found)
        rows += of_shard
        tally.update(of_classes)
    check_splits(manifest, rows, findings)
    if len(work) == len(manifest["shards"]):
        check_classes(folder, tally, findings)
    return findings


def _side_by_side(
    work: Sequence[tuple[Any, ...]], workers: int
) -> Iterator[tuple[Findings, list[SampleRow], ClassCounts]]:
    if workers <= 1:
        yield from (check_shard(*each) for each in work)
        return
    from joblib import Parallel, delayed

    yield from Parallel(n_jobs=workers, return_as="generator")(delayed(check_shard)(*each) for each in work)


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="verify", description="Is a finished dataset what it says it is?")
    parser.add_argument("folder", type=Path, nargs="?", help="the dataset's folder, such as datasets/castle")
    parser.add_argument("--config", type=Path, help="instead of the folder: the config that the dataset is made from")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="with --config: the output folder")
    parser.add_argument(
        "--samples", type=_count, default=100, help="samples that are looked at by all means, or all (default 100)"
    )
    parser.add_argument("--seed", type=int, default=0, help="decides which samples those are (default 0)")
    parser.add_argument("--workers", type=int, default=1, help="shards looked at side by side (default 1)")
    arguments = parser.parse_args(argv)
    if (arguments.folder is None) == (arguments.config is None):
        parser.error("name either the dataset's folder or its config")
    return arguments


def _count(text: str) -> int | None:
    return None if text == "all" else int(text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
