"""Makes the experiments of a paper: datasets and models by their commands, and tables; each is made once."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import yaml

import eval as tables
from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluate import find_table, table_options, write_tables
from eval.engine.evaluation import Figure, TableResult
from eval.engine.results_cache import cached_result
from eval.papers.paper import SCALES, Experiment, Scale, ScaledExperiment
from pipeline.code import code_digest, transitive_imports
from pipeline.errors import ConfigError
from pipeline.paths import file_digest, write_file
from pipeline.yaml_loader import read_yaml
from stages.package.layout import MANIFEST
from stages.package.versions import code_version, library_versions

MAX_PRINTED_LINES = 200
TIMES_FILE = "seconds.json"


@dataclass(frozen=True)
class PaperStep:
    """A command of an experiment, and what came of it.

    experiment, table: which; `table` is empty for datasets, models and commands
    command: as a user would type it
    seconds: that it took when it was made
    result: none for datasets, models, and what could not be made
    missing: what could not be had; the step was not tried
    failure: why it was tried and failed
    """

    experiment: str
    table: str
    command: str
    seconds: float = 0.0
    result: TableResult | None = None
    missing: str = ""
    failure: str = ""

    @property
    def problem(self) -> str:
        """Why there is no result, or an empty text."""
        return self.missing or (f"it failed: {self.failure}" if self.failure else "")


def make_experiment(experiment: Experiment, scale: Scale, folder: Path, workers: int) -> list[PaperStep]:
    """Make an experiment in a folder, and return its steps. What an earlier run made is kept.

    A step that cannot be made says why, and the others go on.
    """
    planned = planned_steps(experiment, scale, folder, workers)
    absent = [path for path in experiment.needs if not path.exists()]
    reason = _not_at_scale(experiment, scale)
    if absent:
        reason = f"needs {absent[0]}, which is not part of this repository and is not here"
    if reason:
        return [replace(step, missing=reason) for step in planned]
    scaled = experiment.scales[scale]
    if experiment.command:
        return [_command_step(step, folder) for step in planned]
    if experiment.files:
        return [_table_step(step, None, scaled, experiment.files, folder, workers) for step in planned]
    assert experiment.config is not None
    config = write_scaled_config(experiment, experiment.config, scale, folder)
    steps, failed = [], ""
    for step in planned:
        if failed:
            steps.append(replace(step, missing=f"needs what {failed} makes, which failed"))
        elif step.table:
            run = load_dataset_run(config, folder, workers)
            steps.append(_table_step(step, run, scaled, (), folder, workers))
        else:
            steps.append(_pipeline_step(step, config, folder))
            failed = step.command if steps[-1].failure else ""
    return steps


def planned_steps(experiment: Experiment, scale: Scale, folder: Path, workers: int) -> list[PaperStep]:
    """Return the steps of an experiment, none of them made."""
    scaled = experiment.scales.get(scale, ScaledExperiment())
    if experiment.command:
        command = " ".join(filter(None, [experiment.command, scaled.arguments]))
        return [PaperStep(experiment.name, "", command.format(out=shlex.quote(str(folder))))]
    given = ["--config", str(_config_path(experiment, folder)), "--out", str(folder)]
    steps = []
    if experiment.config and experiment.dataset:
        steps.append(shlex.join(["shapemill", "run", *given, "--workers", str(workers)]))
    if experiment.train:
        steps.append(shlex.join(["shapemill", "train", *given, "--workers", str(workers)]))
    made = [PaperStep(experiment.name, "", command) for command in steps]
    for table in experiment.tables:
        values = [f"--set={key}={json.dumps(value)}" for key, value in scaled.options.get(table, {}).items()]
        about = [str(path) for path in experiment.files] or given
        made.append(PaperStep(experiment.name, table, shlex.join(["shapemill", "eval", table, *about, *values])))
    return made


def _not_at_scale(experiment: Experiment, scale: Scale) -> str:
    if scale in experiment.scales:
        return ""
    return f"not part of SCALE={scale}; SCALE={' or '.join(name for name in SCALES if name in experiment.scales)}"


def write_scaled_config(experiment: Experiment, config: Path, scale: Scale, folder: Path) -> Path:
    """Write the config of an experiment at a scale into the folder of the run, and return its path."""
    values, _ = read_yaml(config)
    scaled = experiment.scales.get(scale, ScaledExperiment())
    text = yaml.safe_dump(_merged(values, scaled.config), sort_keys=False, allow_unicode=True, width=120)
    return write_file(_config_path(experiment, folder), f"# {config} at SCALE={scale}\n{text}".encode())


def _config_path(experiment: Experiment, folder: Path) -> Path:
    return folder / f"{experiment.name}.yaml"


def _merged(values: Mapping[str, Any], scaled: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with those of `scaled` in their place; sections are merged, lists are replaced."""
    merged = dict(values)
    for key, value in scaled.items():
        before = merged.get(key)
        merged[key] = _merged(before, value) if isinstance(value, Mapping) and isinstance(before, Mapping) else value
    return merged


def _pipeline_step(step: PaperStep, config: Path, folder: Path) -> PaperStep:
    """Run `shapemill run` or `train`, which find what is made already; seconds are those of the longest run."""
    kept: dict[str, Any] = _read_json(folder / TIMES_FILE)
    key = [step.command, file_digest(config)]
    start = perf_counter()
    code = subprocess.run(_arguments(step.command), check=False).returncode
    if code:
        return replace(step, failure=f"exit code {code}; its messages are above")
    seconds = perf_counter() - start
    name = f"{step.experiment} {shlex.split(step.command)[1]}"
    if kept.get(name, {}).get("key") == key:
        seconds = max(seconds, kept[name]["seconds"])
    write_file(folder / TIMES_FILE, json.dumps({**kept, name: {"key": key, "seconds": seconds}}, indent=1).encode())
    return replace(step, seconds=seconds)


def _read_json(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(path.read_bytes()) if path.is_file() else {}
    return content


def _table_step(
    step: PaperStep,
    run: DatasetRun | None,
    scaled: ScaledExperiment,
    files: Sequence[Path],
    folder: Path,
    workers: int,
) -> PaperStep:
    table = find_table(step.table)
    options = table_options(step.table, table.options, scaled.options.get(step.table, {}))
    if run is not None and (missing := table.missing(run)):
        return replace(step, missing=missing)
    inputs = {
        "libraries": library_versions(),
        "options": options.model_dump(mode="json"),
        "code": code_digest(transitive_imports([f"eval.tables.{step.table}"])),
        "files": [file_digest(path) for path in files] if run is None else _inputs_of_run(run),
    }
    if run is not None:
        compute = partial(table.compute, run, options)
    else:
        assert table.compute_from_files is not None
        compute = partial(table.compute_from_files, files, options, workers)
    made = _made(step, inputs, compute, folder)
    if made.result is not None and run is not None:
        write_tables(run, step.table, made.result)
    return made


def _inputs_of_run(run: DatasetRun) -> list[str]:
    """Return the digests of what a table may depend on: the config, and what identifies dataset and models."""
    manifest = run.folder / MANIFEST
    found = [manifest] if manifest.is_file() else []
    return [file_digest(path) for path in (run.config.path, *found, *sorted(run.models.glob("*/*.safetensors")))]


def _command_step(step: PaperStep, folder: Path) -> PaperStep:
    """Run a command, and keep what it printed and the pictures whose paths it printed."""
    arguments = _arguments(step.command)
    inputs = {
        "command": step.command,
        "code": [code_version(tables), _module_digest(arguments[2])],
        "datasets": [file_digest(path) for path in sorted(folder.glob(f"*/{MANIFEST}"))],
    }

    def compute() -> TableResult:
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ConfigError((done.stderr or done.stdout).strip().splitlines()[-1])
        lines = done.stdout.splitlines()
        figures = list(_printed_pictures(lines, folder))
        return TableResult([], figures=figures, printed="\n".join(lines[:MAX_PRINTED_LINES]))

    return _made(step, inputs, compute, folder)


def _module_digest(module: str) -> str:
    """Return the digest of a module's code, or an empty text for a module outside the project."""
    try:
        return code_digest(transitive_imports([module]))
    except ValueError:
        return ""


def _printed_pictures(lines: Sequence[str], folder: Path) -> Iterator[Figure]:
    """Yield the pictures below a folder whose paths a command printed."""
    for line in lines:
        for name in re.findall(re.escape(str(folder)) + r".*?\.png", line):
            if (path := Path(name)).is_file():
                yield Figure(path.stem.lower(), path.stem.replace("-", " ").replace("_", " "), path.read_bytes())


def _made(step: PaperStep, inputs: Mapping[str, Any], compute: Callable[[], TableResult], folder: Path) -> PaperStep:
    """Return the step with its result, computed unless it is kept; a failure is stated, and other steps go on."""
    name = "-".join(filter(None, (step.experiment, step.table)))
    try:
        result, seconds = cached_result(name, inputs, folder / "results" / f"{name}.json", compute)
    except ConfigError as error:
        return replace(step, failure=str(error))
    except Exception as error:
        traceback.print_exc()
        return replace(step, failure=f"{type(error).__name__}: {error}".partition("\n")[0])
    return replace(step, result=result, seconds=seconds)


def _arguments(command: str) -> list[str]:
    """Return the arguments of a command that begins with `shapemill` or `python -m`, with this Python."""
    first, *rest = shlex.split(command)
    return [sys.executable, "-m", "pipeline", *rest] if first == "shapemill" else [sys.executable, *rest]


def limit_waiting_threads() -> None:
    """Let threads that wait sleep: otherwise they take up to a hundred times the processor's time."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
