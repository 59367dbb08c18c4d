"""What a paper publishes, what we get, and the experiments that make it again: the files `eval/papers/<paper>.yaml`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import Field, ValidationError, model_validator

from pipeline.config import StrictModel, mistakes_in_words, nearest_word
from pipeline.errors import ConfigError
from pipeline.yaml_loader import read_yaml

FOLDER = Path(__file__).parent

Verdict = Literal["beaten", "level", "behind", "reproduced", "partly", "not here", "missing", "concept"]
VERDICTS: Mapping[Verdict, str] = {
    "beaten": "ours is better by the paper's own measure",
    "level": "no significant difference, or the published value is reached",
    "behind": "ours is worse",
    "reproduced": "a figure or algorithm is made by our code, and there is no number to compare",
    "partly": "some of it is reproduced; the row says what is missing",
    "not here": "needs data or people that are not available here; the row says which",
    "missing": "could be made here, and is not yet",
    "concept": "explains an idea; there is no result to reproduce",
}

Scale = Literal["minutes", "hours", "full"]
SCALES: tuple[Scale, ...] = get_args(Scale)


class ResultSource(StrictModel):
    """Where a run's report finds a result: in an experiment, one of its tables, and a part of that table."""

    experiment: str
    table: str = Field("", description="one of its tables; all if empty")
    parts: tuple[str, ...] = Field((), description="words of the titles of tables, charts and pictures; all if empty")


class PaperResult(StrictModel):
    """A row: a table or figure of the paper, or a part of one."""

    number: str = Field(pattern=r"^((Table|Figure) \d+|§\d+)$")
    subject: str
    published: str = ""
    ours: str = Field("", description="the kept result of a full run")
    verdict: Verdict
    remark: str = Field("", description="what qualifies the verdict, or what cannot be reproduced here and why")
    command: str = Field("", description="what measured the kept result")
    commit: str = Field("", description="at which it was measured, where that is known")
    measured: date | None = Field(None, description="when it was measured, where the day is known")
    shown: tuple[ResultSource, ...] = Field((), description="where the report of a run finds it")


class ScaledExperiment(StrictModel):
    """An experiment at one scale."""

    config: Mapping[str, Any] = Field({}, description="values in place of the config's, section by section")
    options: Mapping[str, Mapping[str, Any]] = Field({}, description="options of tables, by table")
    arguments: str = Field("", description="further arguments of the command")


class Experiment(StrictModel):
    """A dataset with models and tables, tables about files, or a command."""

    name: str = Field(pattern=r"^[a-z0-9_-]+$")
    config: Path | None = Field(None, description="config of the dataset")
    dataset: bool = Field(True, description="whether its dataset is made; a table may need its config alone")
    train: bool = Field(False, description="whether its models are trained")
    files: tuple[Path, ...] = Field((), description="models that its tables are about")
    tables: tuple[str, ...] = ()
    command: str = Field("", description="a command, with {out} for the folder that it writes to")
    needs: tuple[Path, ...] = Field((), description="files that are not part of this repository")
    scales: Mapping[Scale, ScaledExperiment] = Field(description="the scales that it is part of")

    @model_validator(mode="after")
    def _has_one_subject(self) -> Experiment:
        if sum(map(bool, (self.config, self.files, self.command))) != 1:
            raise ValueError(f"{self.name}: an experiment has either a config, files or a command")
        return self


class Paper(StrictModel):
    """A paper: its results, and the experiments that make them again."""

    title: str
    citation: str
    introduction: str
    notes: str = ""
    smoke_run: str = Field("", description="how long a run with SCALE=minutes took, and on what")
    experiments: tuple[Experiment, ...] = ()
    results: tuple[PaperResult, ...]

    @model_validator(mode="after")
    def _sources_exist(self) -> Paper:
        tables = {experiment.name: experiment.tables for experiment in self.experiments}
        for result in self.results:
            for source in result.shown:
                if source.experiment not in tables:
                    raise ValueError(f"{result.number}: there is no experiment {source.experiment}")
                if source.table and source.table not in tables[source.experiment]:
                    raise ValueError(f"{result.number}: {source.experiment} has no table {source.table}")
        return self


PAPERS = ("strings", "shapeassembly", "substructures", "symmetry", "geocode")
"""Short names of the papers, in the order of pages."""

ALL_PAPERS = "all"


def load_paper(name: str) -> Paper:
    """Read a paper's file. Raises ConfigError for an unknown name or an invalid file."""
    if name not in PAPERS:
        raise ConfigError(unknown_choice("PAPER", name, (*PAPERS, ALL_PAPERS)))
    path = FOLDER / f"{name}.yaml"
    values, _ = read_yaml(path)
    try:
        return Paper.model_validate_json(json.dumps(values))
    except ValidationError as error:
        raise ConfigError("\n".join(f"{path}: {line}" for line in mistakes_in_words(Paper, error, values))) from None


def known_scale(name: str) -> Scale:
    """Return a scale by its name. Raises ConfigError for an unknown one."""
    for scale in SCALES:
        if scale == name:
            return scale
    raise ConfigError(unknown_choice("SCALE", name, SCALES))


def unknown_choice(variable: str, value: str, choices: Sequence[str]) -> str:
    """Return the message for a value that is not among the choices."""
    close = nearest_word(value, choices)
    hint = f"did you mean {close}? " if close else ""
    return f"{variable}={value}: {hint}{variable} is one of {', '.join(choices)}"
