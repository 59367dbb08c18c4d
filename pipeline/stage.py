"""The contract of a stage: a name, a config, a plan, and a pure function that makes one shard.

A stage's `stage.py` holds one module-level `STAGE = Stage(...)`. The engine finds it by the folder's name, asks for
its plan and runs every planned shard without a matching record. Then it asks again until nothing is missing: a later
part of a plan may depend on the records of an earlier part, such as the rounds of a search.

Rules for the author of a stage:

- `plan(plan) -> list[Shard]` runs in the parent, often. It is cheap, without side effects, and depends only on the
  config and on finished records. With more records it may return more shards, and keeps the earlier ones. It leaves
  out what depends on a missing record (`plan.summary` answers None).
- `run_shard(task) -> Outcome` runs in a worker. Its bytes depend on `task.config`, `task.shard`, the files of
  `task.shard.inputs` and `task.rng(...)`, and on nothing else: no clock, no global randomness, no order of a set.
- A shard is rebuilt when its fingerprint changes: the modules that the stage's code imports (`pipeline/code.py`), the
  stage's own config section, dataset name, version and seed, shard name and params, the fingerprints of its inputs.
  Modules found at run time, by a name in the config, go into `Shard.code`. Anything else that its bytes depend on goes
  into `params`: the sha256 of a mesh that it reads, the title that a card shows.
- `task.config` and `plan.config` hold only the sections of the stage and of all stages upstream, since a change of any
  other section would not rebuild a shard. A stage that reads a section of a later stage names it in `sections`, and
  puts into `params` what its shards depend on.
- Files of a shard are named `<shard>.<anything>`. They appear all at once when `run_shard` returns, or never.
- Raise ShardFailed for a shard that may succeed later: it is retried, twice by default. ConfigError and Rejected
  quarantine it at once. Any other exception counts as ShardFailed. An OSError of a full disk or missing permission is
  Fatal, and everything stops. Do not catch those.
- Import native libraries and modules with kernels inside functions: the driver of a run only plans. A worker has one
  thread: the environment is set for BLAS, OpenMP and numba before Python starts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol

from pipeline.config import Config, StrictModel

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Shard:
    """One task of a plan: minutes of work at most.

    name: stem of its files and of its record (letters, digits, `-`, `_`)
    params: contents of the shard, as JSON
    inputs: records that it reads, as `stage/shard`, of earlier stages or of earlier shards of its own stage
    code: modules that it finds at run time, which the stage does not import
    threads: number of threads that it uses; the engine reserves that many workers, or all
    """

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    threads: int = 1


@dataclass(frozen=True)
class Outcome:
    """Result of a finished shard: its number of samples, and a small summary for its record, as JSON."""

    samples: int
    summary: Mapping[str, Any] = field(default_factory=dict)


class Plan(Protocol):
    """What a plan may read: the config, and the records of finished shards."""

    @property
    def config(self) -> Config: ...

    def shards(self, stage: str) -> list[str]:
        """Return the names of all planned shards of an earlier stage, in plan order."""

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        """Return the summary in a shard's record; None while it has no matching record."""

    def rejects(self, stage: str, shard: str) -> Mapping[str, int]:
        """Return the number of refused items by reason; empty while the shard has no matching record."""

    def published(self, file: str) -> Path:
        """Return the path of another dataset's published file, `<its folder>/<file>`; it need not exist.

        A shard that reads it has its sha256 in `params`. Raises ValueError for a name that leads out of the output
        folder.
        """


class Task(Protocol):
    """What `run_shard` receives: its shard, config, inputs, outputs and randomness."""

    @property
    def shard(self) -> Shard: ...

    @property
    def config(self) -> Config: ...

    def rng(self, *decision: str | int) -> np.random.Generator:
        """Return the random stream of one decision: a function of seed, stage, shard and `decision`."""

    def input(self, stage: str, file: str) -> Path:
        """Return a file of an input shard, with the recorded bytes.

        Raises ShardFailed if no input record lists it, or if it is corrupted: the engine then rebuilds it first.
        """

    def published(self, file: str) -> Path:
        """Return the path of another dataset's published file, as `Plan.published`."""

    def output(self, file: str) -> BinaryIO:
        """Open a new file of this shard, named `<shard>.<anything>`; committed with it, or never."""

    def reject(self, item: str, reason: str, detail: str = "", count: int = 1) -> None:
        """Record that `count` items were refused for `reason`."""

    def progress(self, done: int, total: int) -> None:
        """Report the progress of this shard."""


def _no_check(_: Config) -> None:
    return


def _no_report(_: Plan) -> Sequence[str]:
    return ()


def _no_samples(_: Config) -> Sequence[int]:
    return ()


def _always(_: Config, __: str) -> bool:
    return True


def _no_files(_: Plan) -> Mapping[str, str]:
    return {}


@dataclass(frozen=True)
class Stage:
    """One stage of the engine.

    module: `__name__`; the stage's bytes depend on the modules that it imports, directly or not
    inputs: names of the stages that it reads; `*/producer.py` means every stage whose folder holds such a file
    estimate_bytes: returns an upper estimate of the disk that the whole stage takes, in bytes
    report: returns lines about the finished part of the stage, shown after a run and by `status`
    publish: returns the files for the output folder, `{path below OUT: file of a shard}`, when every shard is done;
        the engine links or copies them, and removes what it published before
    check: raises ConfigError for sections that contradict each other; called with the whole config at the start
    check_environment: raises ConfigError for what the config requests and this machine cannot do; called before the
        first shard of the stage, and of the first stage of a dataset; may take seconds
    requested_samples: returns the number of samples that the config requests, for each shard that later stages read
    sections: stages whose config sections it reads without reading the stages
    trial_config: returns its section for a short run: about thirty samples in shards of at most ten
    whole_section: whether a shard's bytes may depend on the whole config section; if False, tasks do not see the
        section, and each shard has in `params` what it needs, so that an edit of one entry rebuilds only its shards
    publishes_incomplete: whether `publish` is called while shards are missing, too
    keep_output: whether its files are kept when intermediates are pruned, because other commands read them
    uses_input: whether shards of a name, or of a prefix of names (empty: all), read other stages
    """

    name: str
    module: str
    config: type[StrictModel]
    inputs: tuple[str, ...]
    plan: Callable[[Plan], list[Shard]]
    run_shard: Callable[[Task], Outcome]
    estimate_bytes: Callable[[Plan], int]
    report: Callable[[Plan], Sequence[str]] = _no_report
    publish: Callable[[Plan], Mapping[str, str]] = _no_files
    check: Callable[[Config], None] = _no_check
    check_environment: Callable[[Config], None] = _no_check
    requested_samples: Callable[[Config], Sequence[int]] = _no_samples
    sections: tuple[str, ...] = ()
    trial_config: Callable[[Config], StrictModel] | None = None
    whole_section: bool = True
    publishes_incomplete: bool = False
    keep_output: bool = False
    uses_input: Callable[[Config, str], bool] = _always

    def may_make_samples(self, config: Config) -> bool:
        """Return False for a producer from which `config` requests nothing."""
        return self.requested_samples is _no_samples or any(self.requested_samples(config))
