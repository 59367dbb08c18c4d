"""`make verify`: is a finished dataset what it says it is?

    python -m pipeline verify --config configs/castle.yaml --out datasets
    python -m stages.package.verify datasets/castle

Files: checksums, members, counts, index, foreign and missing files. Then, for samples chosen at random, contacts,
grammar and penetration computed anew from the meshes, without any cache. Exit code 1, with names, for any fault.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.places import Places
from pipeline.randomness import decision_rng
from pipeline.yaml_text import read_yaml
from stages.package.layout import MANIFEST
from stages.package.verify_files import FileFindings, check_files, shard_samples
from stages.shape.collection.declared import languages

__all__ = ["main"]

LISTED_FAULTS = 20


def main(argv: Sequence[str]) -> int:
    """Verify the dataset that `argv` names, by its folder or by config and output folder; print a table; return the
    exit code."""
    arguments = _arguments(argv)
    folder = arguments.folder or arguments.out / str(read_yaml(arguments.config)[0]["name"])
    if not (folder / MANIFEST).is_file():
        print(f"{folder}: no dataset: it has no {MANIFEST}. Make one with: make dataset")
        return 1
    findings = check_files(folder)
    if arguments.samples and not findings.faults:
        _check_geometry(folder, arguments.samples, arguments.seed, findings)
    _print(folder, findings)
    return 1 if findings.faults else 0


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="verify", description="Is a finished dataset what it says it is?")
    parser.add_argument("folder", type=Path, nargs="?", help="the dataset's folder, such as datasets/castle")
    parser.add_argument("--config", type=Path, help="instead of the folder: the config that the dataset is made from")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="with --config: the output folder")
    parser.add_argument("--samples", type=int, default=50, help="samples whose geometry is computed anew (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="decides which samples those are (default 0)")
    arguments = parser.parse_args(argv)
    if (arguments.folder is None) == (arguments.config is None):
        parser.error("name either the dataset's folder or its config")
    return arguments


def _check_geometry(folder: Path, count: int, seed: int, findings: FileFindings) -> None:
    """Hold `count` random samples of the dataset against what they were made from, as their language does."""
    places = Places(folder.resolve().parent, folder.resolve().name)
    spoken = {name: each.faults(places) for name, each in languages().items()}
    manifest = json.loads((folder / MANIFEST).read_text())
    total = manifest["samples"]
    chosen = np.sort(decision_rng(seed, "verify").choice(total, size=min(count, total), replace=False))
    first = 0
    for shard in manifest["shards"]:
        wanted = {int(each) - first for each in chosen if first <= each < first + shard["samples"]}
        first += shard["samples"]
        if not wanted:
            continue
        for position, (key, _, members) in enumerate(shard_samples(folder / shard["path"])):
            if position in wanted:
                findings.look("geometry")
                for what in spoken[json.loads(members["json"])["language"]](members):
                    findings.fault("geometry", f"{shard['path']}: {key}", what)


def _print(folder: Path, findings: FileFindings) -> None:
    print(f"{folder}")
    for check in sorted({*findings.checked, *findings.faults}):
        faults = findings.faults.get(check, [])
        verdict = f"{len(faults)} faults" if faults else "good"
        print(f"  {check:<15}{findings.checked.get(check, 0):>9,} looked at   {verdict}")
    for check, faults in findings.faults.items():
        for fault in faults[:LISTED_FAULTS]:
            print(f"{check}: {fault}")
        if len(faults) > LISTED_FAULTS:
            print(f"{check}: and {len(faults) - LISTED_FAULTS} more")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
