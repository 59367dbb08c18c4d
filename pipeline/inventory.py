"""What is planned and what is done, read from the config and the records alone. Nothing here writes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.code import code_digest, entry_points, transitive_imports
from pipeline.config import Config
from pipeline.paths import DatasetPaths, StagePaths, read_json
from pipeline.records import ShardRecord, fingerprint, read_record, recipe
from pipeline.registry import upstream
from pipeline.stage import Plan, Shard, Stage
from pipeline.task import Job

_SHARD_NAME = re.compile(r"[A-Za-z0-9_-]+")


@dataclass
class StageInventory:
    """One stage: its plan as far as it is known, the recipe and the fingerprint of each shard, the records that match
    and those that do not, the shards with matching records whose files were let go of, and the digest of each module
    that its code reaches."""

    stage: Stage
    config: Config
    paths: StagePaths
    view: Plan
    shards: list[Shard] = field(default_factory=list)
    recipes: dict[str, dict[str, str]] = field(default_factory=dict)
    fingerprints: dict[str, str] = field(default_factory=dict)
    records: dict[str, ShardRecord] = field(default_factory=dict)
    pruned: set[str] = field(default_factory=set)
    outdated: dict[str, ShardRecord] = field(default_factory=dict)
    code: dict[str, str] = field(default_factory=dict)

    @property
    def missing(self) -> list[Shard]:
        """Planned shards without a matching record, in plan order."""
        return [shard for shard in self.shards if shard.name not in self.records]

    def ready(self, shard: Shard) -> bool:
        """Whether what `shard` reads of its own stage is done."""
        own = f"{self.stage.name}/"
        return all(each.removeprefix(own) in self.records for each in shard.inputs if each.startswith(own))


class Inventory:
    """Plans and records of the stages of a dataset, each read when first asked for."""

    def __init__(self, config: Config, stages: Mapping[str, Stage], places: DatasetPaths) -> None:
        self.config = config
        self._stages = stages
        self._places = places
        self._surveyed: dict[str, StageInventory] = {}
        self._reached: dict[tuple[str, ...], dict[str, str]] = {}

    def stage(self, name: str) -> StageInventory:
        """What is known of stage `name`."""
        if name not in self._surveyed:
            reads = upstream(self._stages, name)
            config = self.config.only(dict.fromkeys([*reads, *self._stages[name].sections]))
            view = _View(self, name, config, frozenset(reads))
            self._surveyed[name] = StageInventory(self._stages[name], config, self._places.stage(name), view)
            self.refresh(name)
        return self._surveyed[name]

    def refresh(self, name: str) -> StageInventory:
        """Ask the plan of stage `name` and read its records, again and again until neither brings news.

        Raises ValueError for a plan that breaks its contract.
        """
        surveyed = self._surveyed[name]
        section = surveyed.config.sections[name].model_dump(mode="json") if surveyed.stage.whole_section else {}
        dataset = (self.config.name, self.config.version, self.config.seed)
        while True:
            surveyed.shards = surveyed.stage.plan(surveyed.view)
            surveyed.recipes.clear()
            known: dict[str, str] = {}
            for shard in surveyed.shards:
                if not _SHARD_NAME.fullmatch(shard.name) or shard.name in known:
                    raise ValueError(f"plan of {name}: shard name {shard.name!r} is malformed or stands twice")
                inputs = {each: self._input_fingerprint(name, known, shard, each) for each in shard.inputs}
                code = self._code(surveyed.stage, shard)
                surveyed.code.update(code)
                surveyed.recipes[shard.name] = recipe(name, shard, code_digest(code), section, dataset, inputs)
                known[shard.name] = fingerprint(surveyed.recipes[shard.name])
            surveyed.fingerprints = known
            news = self._read_records(surveyed)
            if not news:
                return surveyed

    def accept(self, name: str, shard: str) -> None:
        """Take in the record of a shard that was made just now."""
        surveyed = self._surveyed[name]
        record = read_record(surveyed.paths.records / f"{shard}.json")
        if record is not None and record.fingerprint == surveyed.fingerprints[shard]:
            surveyed.records[shard] = record

    def reread(self) -> None:
        """Read plans and records anew when next asked: those of any stage may be others now."""
        self._surveyed.clear()

    def job(self, name: str, shard: Shard) -> Job:
        """What a worker must know to make a shard of stage `name` whose inputs are all there."""
        surveyed = self._surveyed[name]
        inputs = {
            f"{stage}/{file}": noted["sha256"]
            for stage, _, other in (each.partition("/") for each in shard.inputs)
            for file, noted in self.stage(stage).records[other].files.items()
        }
        return Job(
            stage=name,
            run_shard=surveyed.stage.run_shard,
            shard=shard,
            config=surveyed.config if surveyed.stage.whole_section else _without(surveyed.config, name),
            paths=self._places,
            recipe=surveyed.recipes[shard.name],
            inputs=inputs,
            starts=entry_points(surveyed.stage.module, shard.code),
            code=self._code(surveyed.stage, shard),
        )

    def complete(self, name: str) -> bool:
        """Whether stage `name` and every stage it reads is done."""
        return all(not self.stage(each).missing for each in upstream(self._stages, name))

    def _code(self, stage: Stage, shard: Shard) -> dict[str, str]:
        """The code of a shard, as it was when first asked for: a run is of one state of the code."""
        key = (stage.module, *shard.code)
        if key not in self._reached:
            self._reached[key] = transitive_imports(entry_points(stage.module, shard.code))
        return self._reached[key]

    def _input_fingerprint(self, name: str, known: Mapping[str, str], shard: Shard, wanted: str) -> str:
        stage, _, other = wanted.partition("/")
        if stage not in upstream(self._stages, name):
            raise ValueError(f"plan of {name}: shard {shard.name} reads {wanted}, but {stage} is no input of {name}")
        fingerprints = known if stage == name else self.stage(stage).fingerprints
        if other not in fingerprints:
            raise ValueError(f"plan of {name}: shard {shard.name} reads {wanted}, which is not planned before it")
        return fingerprints[other]

    def _read_records(self, surveyed: StageInventory) -> bool:
        before = set(surveyed.records)
        matching: dict[str, ShardRecord] = {}
        surveyed.outdated.clear()
        surveyed.pruned.clear()
        seals = read_json(surveyed.paths.pruned) if self.config.keep == "dataset" else None
        seals = seals if isinstance(seals, dict) else {}
        for name, wanted in surveyed.fingerprints.items():
            record = surveyed.records.get(name)
            if record is None or record.fingerprint != wanted:
                record = read_record(surveyed.paths.records / f"{name}.json")
            if record is None:
                continue
            there = record.is_whole(surveyed.paths)
            gone = not there and seals.get(name) == record.checksum()
            if gone:
                surveyed.pruned.add(name)
            whole = record.fingerprint == wanted and (there or gone)
            if whole and self._read_what_is_there(surveyed.stage.name, matching, record):
                matching[name] = record
            else:
                surveyed.outdated[name] = record
        surveyed.records = matching
        return set(matching) != before

    def _read_what_is_there(self, name: str, own: Mapping[str, ShardRecord], record: ShardRecord) -> bool:
        """Whether a shard of stage `name` was made of the bytes that its inputs have now, by their records; `own` are
        those of its own stage that are good. An input that was made again with the same bytes changes nothing."""
        for read, digest in record.inputs.items():
            stage, _, file = read.partition("/")
            records = own if stage == name else self.stage(stage).records
            source = records.get(file.partition(".")[0])
            if source is None or source.files.get(file, {}).get("sha256") != digest:
                return False
        return True


def _without(config: Config, stage: str) -> Config:
    return config.only(each for each in config.sections if each != stage)


class _View:
    """The Plan that a stage's functions see."""

    def __init__(self, survey: Inventory, name: str, config: Config, reads: frozenset[str]) -> None:
        self._survey = survey
        self._name = name
        self._reads = reads
        self.config = config

    def _stage(self, stage: str) -> StageInventory:
        if stage not in self._reads:
            raise ValueError(f"plan of {self._name} looks at stage {stage}, which is not among its inputs")
        # Its own survey is under way while the plan is asked; what is known so far is what the plan may know.
        return self._survey._surveyed[stage] if stage == self._name else self._survey.stage(stage)

    def shards(self, stage: str) -> list[str]:
        return [shard.name for shard in self._stage(stage).shards]

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        record = self._stage(stage).records.get(shard)
        return None if record is None else record.summary

    def rejects(self, stage: str, shard: str) -> Mapping[str, int]:
        record = self._stage(stage).records.get(shard)
        return {} if record is None else record.rejects

    def published(self, file: str) -> Path:
        return self._survey._places.published(file)
