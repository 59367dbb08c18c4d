"""What a stage is to the mill: a name, a config, a plan, and a pure function that makes one shard.

A stage's `stage.py` holds one module-level `STAGE = Stage(...)`. The mill finds it by the stage's name, asks it
for its plan, runs every planned shard that has no matching record, and asks again until nothing is missing (so
a later part of a plan may depend on the records of an earlier part, as the rounds of a search do).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from pipeline.config import Config, StrictModel

__all__ = ["Outcome", "Plan", "Shard", "Stage", "Task"]


@dataclass(frozen=True)
class Shard:
    """One task of a plan: minutes of work at most.

    `name` is the stem of its files and of its record (letters, digits, `-`, `_`). `params` is JSON and says what
    the shard holds. `inputs` names the records it reads, as `stage/shard`, of earlier stages or of earlier
    shards of its own stage.
    """

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()


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


class Task(Protocol):
    """What `run_shard` gets: its shard, the config, its inputs, its outputs, its randomness."""

    @property
    def shard(self) -> Shard: ...

    @property
    def config(self) -> Config: ...

    def rng(self, *decision: str | int) -> np.random.Generator:
        """The stream of one decision inside this shard: counted from seed, stage, shard and `decision`."""

    def input(self, stage: str, file: str) -> Path:
        """A file that an input shard has committed. Raises ShardFailed if no input record lists it."""

    def output(self, file: str) -> BinaryIO:
        """A stream to a new file of this shard, `file` being a bare name; committed with the shard, or not at all."""

    def reject(self, item: str, reason: str, detail: str = "", count: int = 1) -> None:
        """Record that `count` items were refused for `reason`; counted in the record, listed in rejects.jsonl."""

    def progress(self, done: int, total: int) -> None:
        """Tell the bar how far this shard is."""


@dataclass(frozen=True)
class Stage:
    """One stage of the mill. `version` is part of every fingerprint: raise it when the stage's bytes change."""

    name: str
    version: int
    config: type[StrictModel]
    inputs: tuple[str, ...]
    plan: Callable[[Plan], list[Shard]]
    run_shard: Callable[[Task], Outcome]
    estimate_bytes: Callable[[Plan], int]
