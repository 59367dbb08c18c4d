"""`make verify`: verification of a finished dataset.

    shapemill verify --config configs/castle.yaml --out datasets
    shapemill verify datasets/castle

Files: checksums, listings, index, splits, foreign and missing files. Every sample: members, arrays, record, mesh and
points against its record, and against the shards of all stages where the work folder still exists. A random choice of
samples: contacts, grammar, penetration, statics and drawings, recomputed by independent means. Exit code 1, with names,
for any fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from pipeline.display import ticking, watching
from pipeline.randomness import decision_rng
from stages.package.layout import MANIFEST, VERIFIER
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
from stages.verification.verified import record_verification


def print_findings(folder: Path, samples: int | None, seed: int, workers: int) -> int:
    """Verify the dataset in `folder`, print a table, store the result, return the exit code: 1 for any fault."""
    if not (folder / MANIFEST).is_file():
        print(f"{folder}: no dataset: it has no {MANIFEST}. Make one with: make dataset")
        return 1
    findings = verify_dataset(folder, samples, seed, workers)
    print("\n".join([str(folder), *findings.lines()]))
    try:
        record_verification(folder, bool(findings.faults))
    except OSError as error:
        print(f"the result cannot be stored, which publishing needs: {error.strerror}")
    return 1 if findings.faults else 0


def verify_dataset(folder: Path, samples: int | None, seed: int, workers: int = 1) -> Findings:
    """Verify the dataset in `folder`; never raises for faults of its files.

    samples: number of samples rechecked by independent means; None: all
    """
    findings = Findings()
    with ticking("verify", "comparing checksums"):
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
            rechecked = {number - first for number in chosen if first <= number < first + shard["samples"]}
            work.append((folder, shard, manifest, schema, index, rechecked))
        first += shard["samples"]
    rows: list[SampleRow] = []
    tally: ClassCounts = ClassCounts()
    for shard_findings, shard_rows, counts in _check_shards(work, workers):
        findings.add(shard_findings)
        rows += shard_rows
        tally.update(counts)
    with ticking("verify", "running a verifier of its own"):
        _check_standalone(folder, samples, seed, workers, findings)
    check_splits(manifest, rows, findings)
    if len(work) == len(manifest["shards"]):
        check_classes(folder, tally, findings)
    return findings


def _check_standalone(folder: Path, samples: int | None, seed: int, workers: int, findings: Findings) -> None:
    """Run the verifier that comes with each dataset: our copy of it, since a dataset may be a stranger's."""
    from stages.package.standalone_verifier import verify

    found = verify(folder, samples, seed, workers)
    findings.look(VERIFIER, found.checked["samples"])
    for fault in found.faults:
        where, _, what = fault.partition(": ")
        findings.fault(VERIFIER, where, what)


def _check_shards(
    work: Sequence[tuple[Any, ...]], workers: int
) -> Iterator[tuple[Findings, list[SampleRow], ClassCounts]]:
    """Verify shards, in their order, and show how far this is: each has a file that gets a byte for each sample."""
    from joblib import Parallel, delayed

    with TemporaryDirectory(prefix="shapemill-verify-") as folder:
        marks = [Path(folder) / str(number) for number in range(len(work))]
        total = sum(shard["samples"] for _, shard, *_ in work)
        with watching("verify", total, "samples", lambda: sum(map(_size, marks))):
            yield from Parallel(n_jobs=workers, return_as="generator")(
                delayed(check_shard)(*arguments, path) for arguments, path in zip(work, marks, strict=True)
            )


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
