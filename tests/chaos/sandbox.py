"""A sandbox of chaos tests: small datasets in one folder, their expected files, and runs that receive faults."""

from __future__ import annotations

import hashlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.paths import remove
from pipeline.records import read_record
from pipeline.shards import json_bytes
from tests.chaos.running import Run

Step = tuple[str, str]
"""A dataset and one of its stages."""

ROOT = Path(__file__).resolve().parents[2]

_DIFFERS = {"seconds", "peak_bytes"}


@dataclass
class Sandbox:
    """Datasets in one folder, made with two workers.

    steps: dataset and stage of each run, in order
    sections: config sections of each dataset
    edited: sections with other values, by dataset
    expected: digest of every file below `out` after undisturbed runs, by path
    """

    folder: Path
    name: str
    steps: Sequence[Step]
    sections: Mapping[str, Mapping[str, Any]]
    edited: Sequence[Mapping[str, Mapping[str, Any]]] = ()
    expected: dict[str, str] = field(default_factory=dict)

    @property
    def out(self) -> Path:
        return self.folder / "out"

    @property
    def work(self) -> Path:
        return self.out / ".work"

    def config(self, dataset: str) -> Path:
        return self.folder / f"{dataset}.yaml"

    def write_configs(self, edited: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        """Write the configs, with other values for some sections."""
        for dataset, own in self.sections.items():
            changed = (edited or {}).get(dataset, {})
            sections = {key: {**own.get(key, {}), **changed.get(key, {})} for key in {**own, **changed}}
            facts = {"name": dataset, "seed": 3, "license": "MIT"}
            self.config(dataset).write_text(yaml.safe_dump({**facts, **sections}), encoding="utf-8")

    def settle(self) -> None:
        """Make the datasets without faults, and keep the digests. Raises AssertionError where that fails."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.write_configs()
        run = self.start(self.steps)
        assert run.end() == 0, run.output()
        self.expected = self.digests()

    def start(self, steps: Sequence[Step], *options: str, prepare: Callable[[], None] | None = None) -> Run:
        """Start `make dataset` from the first of `steps` on; `prepare` runs in the process before it begins."""
        asked = [f"{stage}={self.config(dataset)}" for dataset, stage in steps]
        driver = [sys.executable, "-m", "tests.chaos.driver", ",".join(asked)]

        def begin() -> None:
            # A background process ignores Ctrl-C, and its children inherit that.
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            if prepare is not None:
                prepare()

        output = self.folder / f"output-{time.monotonic_ns()}.txt"
        with open(output, "wb") as stream:
            process = subprocess.Popen(
                [*driver, "--out", str(self.out), "--workers", "2", *options],
                cwd=ROOT,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
                preexec_fn=begin,
            )
        return Run(process, output)

    def records(self, step: Step) -> Path:
        """The folder with the records of a stage of a dataset."""
        return self.work / step[0] / step[1] / "records"

    def shards(self, step: Step) -> list[str]:
        """The shards of a stage that have records."""
        return sorted(path.stem for path in self.records(step).glob("*.json"))

    def delete_shards(self, step: Step, shards: Sequence[str]) -> None:
        """Delete shards as if they had never been made: record first, then the files."""
        for shard in shards:
            path = self.records(step) / f"{shard}.json"
            record = read_record(path)
            path.unlink(missing_ok=True)
            for file in record.files if record else ():
                (path.parents[1] / file).unlink(missing_ok=True)

    def written(self) -> dict[Path, int]:
        """Return the time at which each existing record was written, in nanoseconds."""
        found = {}
        for path in self.work.glob("*/*/records/*.json"):
            try:
                found[path] = path.stat().st_mtime_ns
            except FileNotFoundError:  # a run is active
                continue
        return found

    def clear(self) -> None:
        """Delete everything that was made."""
        if self.out.exists():
            remove(self.out)

    def digests(self) -> dict[str, str]:
        """Return the digest of every file below `out` but logs and locks, without the times in records."""
        found = {}
        for path in sorted(self.out.rglob("*")):
            log = path.suffix == ".txt" and path.parent.parent == self.work
            if path.is_file() and not log and not path.name.startswith("lock"):
                found[str(path.relative_to(self.out))] = _digest(path)
        return found

    def half_written(self, spared: set[str]) -> list[str]:
        """Return files under a final name that differ from the expected ones, without `spared`."""
        passing = {"progress", "failed", "rejects"}
        return [
            path
            for path, digest in self.digests().items()
            if path not in spared
            and not Path(path).name.startswith(".")
            and Path(path).parent.name not in passing
            and self.expected.get(path) != digest
        ]


def _digest(path: Path) -> str:
    content = path.read_bytes()
    if path.parent.name == "records":
        record = read_record(path)
        if record is None:
            return "no record"
        content = json_bytes({key: value for key, value in vars(record).items() if key not in _DIFFERS})
    return hashlib.sha256(content).hexdigest()
