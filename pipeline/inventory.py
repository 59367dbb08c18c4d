"""Inventory of planned and finished shards, read from the config and the records. Nothing here writes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.code import SourceTree, code_digest, entry_points, transitive_imports
from pipeline.config import Config
from pipeline.paths import DatasetPaths, StagePaths, read_json
from pipeline.records import ShardRecord, fingerprint, read_record, recipe
from pipeline.registry import upstream
from pipeline.stage import Plan, Shard, Stage
from pipeline.task import Job

_SHARD_NAME = re.compile(r"[A-Za-z0-9_-]+")


@dataclass
class StageInventory:
    """Plan and records of one stage; mappings are by shard.

    shards: the plan as far as it is known
    recipes, fingerprints: of each planned shard
    records: records that match
    pruned: shards with a matching record whose files were pruned
    outdated: records that do not match
    code: digest of each module that the stage's code imports
    """

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
        """Whether the shards of its own stage that a shard reads are done."""
        own = f"{self.stage.name}/"
        return all(source.removeprefix(own) in self.records for source in shard.inputs if source.startswith(own))


class Inventory:
    """Plans and records of the stages of a dataset, read lazily."""

    def __init__(self, config: Config, stages: Mapping[str, Stage], paths: DatasetPaths) -> None:
        self.config = config
        self._stages = stages
        self._paths = paths
        self._states: dict[str, StageInventory] = {}
        self._code_digests: dict[tuple[str, ...], dict[str, str]] = {}
        self._modules: dict[str, str] = {}
        self._trees: dict[tuple[str, ...], SourceTree] = {}

    def stage(self, name: str) -> StageInventory:
        """Return the inventory of stage `name`."""
        if name not in self._states:
            reads = upstream(self._stages, name)
            config = self.config.only(dict.fromkeys([*reads, *self._stages[name].sections]))
            view = _View(self, name, config, frozenset(reads))
            self._states[name] = StageInventory(self._stages[name], config, self._paths.stage(name), view)
            self.refresh(name)
        return self._states[name]

    def refresh(self, name: str) -> StageInventory:
        """Repeat planning stage `name` and reading its records until nothing changes.

        Raises ValueError for a plan that breaks its contract.
        """
        state = self._states[name]
        section = state.config.sections[name].model_dump(mode="json") if state.stage.whole_section else {}
        dataset = (self.config.name, self.config.version, self.config.seed)
        while True:
            state.shards = state.stage.plan(state.view)
            state.recipes.clear()
            known: dict[str, str] = {}
            for shard in state.shards:
                if not _SHARD_NAME.fullmatch(shard.name) or shard.name in known:
                    raise ValueError(f"plan of {name}: shard name {shard.name!r} is malformed or duplicate")
                inputs = {source: self._input_fingerprint(name, known, shard, source) for source in shard.inputs}
                code = self._code(state.stage, shard)
                state.code.update(code)
                state.recipes[shard.name] = recipe(name, shard, code_digest(code), section, dataset, inputs)
                known[shard.name] = fingerprint(state.recipes[shard.name])
            state.fingerprints = known
            if not self._read_records(state):
                return state

    def accept(self, name: str, shard: str) -> None:
        """Add the record of a shard that was just made."""
        state = self._states[name]
        record = read_record(state.paths.records / f"{shard}.json")
        if record is not None and record.fingerprint == state.fingerprints[shard]:
            state.records[shard] = record

    def reread(self) -> None:
        """Read all plans and records from disk when they are needed next."""
        self._states.clear()

    def job(self, name: str, shard: Shard) -> Job:
        """Return the job of a shard of stage `name` whose inputs exist."""
        state = self._states[name]
        inputs = {
            f"{stage}/{file}": entry["sha256"]
            for stage, _, other in (source.partition("/") for source in shard.inputs)
            for file, entry in self.stage(stage).records[other].files.items()
        }
        return Job(
            stage=name,
            run_shard=state.stage.run_shard,
            shard=shard,
            config=state.config if state.stage.whole_section else _without(state.config, name),
            paths=self._paths,
            recipe=state.recipes[shard.name],
            inputs=inputs,
            starts=entry_points(state.stage.module, shard.code),
            code=self._code(state.stage, shard),
        )

    def code_of(self, names: Iterable[str]) -> dict[str, str]:
        """Return the digests of the modules of some stages, as they first were in this run.

        Workers are kept from stage to stage: a shard whose code is another by then is not made.
        """
        return {module: digest for name in names for module, digest in self._code_of(self._stages[name].module).items()}

    def complete(self, name: str) -> bool:
        """Whether stage `name` and every stage it reads is done."""
        return all(not self.stage(read).missing for read in upstream(self._stages, name))

    def _code(self, stage: Stage, shard: Shard) -> dict[str, str]:
        return self._code_of(stage.module, *shard.code)

    def _code_of(self, *modules: str) -> dict[str, str]:
        """Return the digests of a stage's code, each as it first was: a run, and its workers, have one state of it."""
        if modules not in self._code_digests:
            packages = tuple(sorted({module.partition(".")[0] for module in (__name__, *modules)}))
            tree = self._trees.setdefault(packages, SourceTree(packages))
            now = transitive_imports(entry_points(modules[0], modules[1:], tree), tree)
            self._code_digests[modules] = {name: self._modules.setdefault(name, digest) for name, digest in now.items()}
        return self._code_digests[modules]

    def _input_fingerprint(self, name: str, known: Mapping[str, str], shard: Shard, wanted: str) -> str:
        stage, _, other = wanted.partition("/")
        if stage not in upstream(self._stages, name):
            raise ValueError(f"plan of {name}: shard {shard.name} reads {wanted}, but {stage} is no input of {name}")
        fingerprints = known if stage == name else self.stage(stage).fingerprints
        if other not in fingerprints:
            raise ValueError(f"plan of {name}: shard {shard.name} reads {wanted}, which is not planned earlier")
        return fingerprints[other]

    def _read_records(self, state: StageInventory) -> bool:
        before = set(state.records)
        matching: dict[str, ShardRecord] = {}
        state.outdated.clear()
        state.pruned.clear()
        pruned = read_json(state.paths.pruned) if self.config.keep == "dataset" else None
        pruned = pruned if isinstance(pruned, dict) else {}
        for name, wanted in state.fingerprints.items():
            record = state.records.get(name)
            if record is None or record.fingerprint != wanted:
                record = read_record(state.paths.records / f"{name}.json")
            if record is None:
                continue
            complete = record.is_whole(state.paths)
            if not complete and pruned.get(name) == record.checksum():
                state.pruned.add(name)
                complete = True
            current = record.fingerprint == wanted and complete
            if current and self._inputs_unchanged(state.stage.name, matching, record):
                matching[name] = record
            else:
                state.outdated[name] = record
        state.records = matching
        return set(matching) != before

    def _inputs_unchanged(self, name: str, own: Mapping[str, ShardRecord], record: ShardRecord) -> bool:
        """Whether the inputs of a shard of stage `name` have the bytes that it read, by their records.

        own: matching records of its own stage
        """
        for read, digest in record.inputs.items():
            stage, _, file = read.partition("/")
            records = own if stage == name else self.stage(stage).records
            source = records.get(file.partition(".")[0])
            if source is None or source.files.get(file, {}).get("sha256") != digest:
                return False
        return True


def _without(config: Config, stage: str) -> Config:
    return config.only(name for name in config.sections if name != stage)


class _View:
    """The Plan that a stage's functions receive."""

    def __init__(self, inventory: Inventory, name: str, config: Config, reads: frozenset[str]) -> None:
        self._inventory = inventory
        self._name = name
        self._reads = reads
        self.config = config

    def _stage(self, stage: str) -> StageInventory:
        if stage not in self._reads:
            raise ValueError(f"plan of {self._name} looks at stage {stage}, which is not among its inputs")
        # The plan of its own stage is being made: it may read what is known so far.
        return self._inventory._states[stage] if stage == self._name else self._inventory.stage(stage)

    def shards(self, stage: str) -> list[str]:
        return [shard.name for shard in self._stage(stage).shards]

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        record = self._stage(stage).records.get(shard)
        return None if record is None else record.summary

    def rejects(self, stage: str, shard: str) -> Mapping[str, int]:
        record = self._stage(stage).records.get(shard)
        return {} if record is None else record.rejects

    def published(self, file: str) -> Path:
        return self._inventory._paths.published(file)
