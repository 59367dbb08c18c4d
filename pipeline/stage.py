"""What a stage is to the mill: a name, a config, a plan, and a pure function that makes one shard.

A stage's `stage.py` holds one module-level `STAGE = Stage(...)`. The mill finds it by the folder's name, asks it
for its plan, runs every planned shard that has no matching record, and asks again until nothing is missing (so
a later part of a plan may depend on the records of an earlier part, as the rounds of a search do).

The contract for who writes a stage:

- `plan(plan) -> list[Shard]` runs in the parent, often; it is cheap, has no side effects and is a function of the
  config and of finished records alone. Asked again after more records are there it may answer with more shards,
  and keeps the shards it has named before. While a record that the rest of a plan depends on is missing
  (`plan.summary` answers None), leave the rest out.
- `run_shard(task) -> Outcome` runs in a worker. What it writes depends on `task.config`, `task.shard`, the files of
  `task.shard.inputs` and `task.rng(...)`, and on nothing else: no clock, no global randomness, no order of a set.
- A shard is made again when its fingerprint changes: the code that the stage's folder reaches (`pipeline/code.py`),
  the stage's own config section, dataset name, version and seed, shard name and params, the fingerprints of its
  inputs. Code that is found at run time, by a name in the config, goes into `Shard.code`. Whatever else its bytes
  depend on goes into `params`: the sha256 of a mesh that it reads, the title that a card shows.
- `task.config` and `plan.config` hold only the sections of the stage and of the stages it can read (its `inputs`,
  and theirs), because a shard could not be made again for a change of any other. A stage that looks at a section of a
  later stage names it in `sections`; what its shards depend on there goes into their `params`.
- Files of a shard are named `<shard>.<anything>`. They appear all at once when `run_shard` returns, or not at all.
- Raise ShardFailed when the shard cannot be made now and may succeed later: it is tried again, twice by default.
  ConfigError or Rejected set it aside at once. Any other exception counts as ShardFailed. An OSError that says
  "disk full" or "no permission" is Fatal: everything stops. Do not catch those.
- Import native libraries inside functions. One thread a worker: the environment is set for BLAS, OpenMP and
  numba before Python starts.
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

    `name` is the stem of its files and of its record (letters, digits, `-`, `_`). `params` is JSON and says what
    the shard holds. `inputs` names the records it reads, as `stage/shard`, of earlier stages or of earlier
    shards of its own stage. `code` names the modules that it finds at run time, and no import of the stage reaches.
    `threads` is how many threads it works with: the mill puts that many workers aside for it, or all that it has.
    """

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    threads: int = 1


@dataclass(frozen=True)
class Outcome:
    """What a finished shard tells the mill: how many samples it wrote, and a small JSON summary for its record."""

    samples: int
    summary: Mapping[str, Any] = field(default_factory=dict)


class Plan(Protocol):
    """What a plan may look at: the config, and the records of finished shards."""

    @property
    def config(self) -> Config: ...

    def shards(self, stage: str) -> list[str]:
        """Names of all planned shards of an earlier stage, in plan order."""

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        """The summary in a shard's record, or None while that shard has no matching record."""

    def rejects(self, stage: str, shard: str) -> Mapping[str, int]:
        """How many items a shard has refused, by reason; empty while that shard has no matching record."""

    def published(self, file: str) -> Path:
        """Where another dataset publishes a file, as `<its folder>/<file>`, whether it is there or not. A shard that is
        to read it has its sha256 in `params`. Raises ValueError for a name that leads out of the output folder."""


class Task(Protocol):
    """What `run_shard` gets: its shard, the config, its inputs, its outputs, its randomness."""

    @property
    def shard(self) -> Shard: ...

    @property
    def config(self) -> Config: ...

    def rng(self, *decision: str | int) -> np.random.Generator:
        """The stream of one decision inside this shard: counted from seed, stage, shard and `decision`."""

    def input(self, stage: str, file: str) -> Path:
        """A file that an input shard has committed, with the bytes that it had then. Raises ShardFailed if no input
        record lists it; if it is damaged, the mill makes it again first."""

    def published(self, file: str) -> Path:
        """Where another dataset publishes a file, as `Plan.published` says it."""

    def output(self, file: str) -> BinaryIO:
        """A stream to a new file of this shard, named `<shard>.<anything>`; committed with it, or not at all."""

    def reject(self, item: str, reason: str, detail: str = "", count: int = 1) -> None:
        """Record that `count` items were refused for `reason`; counted in the record, listed in rejects.jsonl."""

    def progress(self, done: int, total: int) -> None:
        """Tell the bar how far this shard is."""


def _nothing_wrong(_: Config) -> None:
    return


def _no_report(_: Plan) -> Sequence[str]:
    return ()


def _nothing_asked(_: Config) -> Sequence[int]:
    return ()


def _always(_: Config, __: str) -> bool:
    return True


def _nothing_published(_: Plan) -> Mapping[str, str]:
    return {}


@dataclass(frozen=True)
class Stage:
    """One stage of the mill. `module` is `__name__`: the code that its bytes depend on is what is reached from there.

    `inputs` are the stages that it reads, by name; `*/producer.py` stands for every stage whose folder holds a file of
    that name. `sections` are stages whose sections of the config it looks at without reading them.

    `estimate_bytes` answers how much disk the whole stage will take at most about. `report`: lines about the
    finished part of the stage, for people, shown after a run and by `status`. `publish`: asked when every shard
    is done, which files stand in the output folder itself, `{path below OUT: file of a shard}`; the mill links
    them there (or copies, where the disk has no links) and takes away what it published before and no more.
    `check`: asked with the whole config before anything starts; raises ConfigError for sections that do not go
    together. `check_machine`: asked before the stage makes its first shards, and before the stages that everything
    begins with do; raises ConfigError for what this machine cannot do and the config asks for. May take seconds.

    For `make plan`, a stage that makes samples says in `asked` how many the config wants, shard by shard of those that
    later stages read, and in `trial` its section for a short run: some thirty samples in shards of at most ten.

    `whole_section`: whether the bytes of each shard may depend on all of the stage's section. Where its entries are
    apart, and an edit of one must not make the shards of another anew, say False: tasks then do not see the section,
    and each shard has in its `params` what it needs of it. `publishes_parts`: `publish` is asked while shards are
    missing, too, and names what is there of whole results. `stays`: its files stay where a config lets go of what lies
    between, for other commands look at them. `reads_inputs`: whether shards called so (a name, or the
    beginning of one; empty: all) read anything of other stages, which then must be finished before.
    """

    name: str
    module: str
    config: type[StrictModel]
    inputs: tuple[str, ...]
    plan: Callable[[Plan], list[Shard]]
    run_shard: Callable[[Task], Outcome]
    estimate_bytes: Callable[[Plan], int]
    report: Callable[[Plan], Sequence[str]] = _no_report
    publish: Callable[[Plan], Mapping[str, str]] = _nothing_published
    check: Callable[[Config], None] = _nothing_wrong
    check_environment: Callable[[Config], None] = _nothing_wrong
    requested_samples: Callable[[Config], Sequence[int]] = _nothing_asked
    sections: tuple[str, ...] = ()
    trial_config: Callable[[Config], StrictModel] | None = None
    whole_section: bool = True
    publishes_incomplete: bool = False
    keep_output: bool = False
    uses_input: Callable[[Config, str], bool] = _always
