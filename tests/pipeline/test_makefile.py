"""The Makefile: its targets call the engine with the values of variables, and never run a value."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

ROOT = Path(__file__).resolve().parents[2]
VARIABLES = (
    "CONFIG",
    "OUT",
    "WORK",
    "WORKERS",
    "SEED",
    "STALL_TIMEOUT",
    "CLUSTER",
    "MESH",
    "PROGRAM",
    "INPUT",
    "UP",
    "MODEL",
    "TABLE",
    "PAPER",
    "SCALE",
    "SAMPLES",
    "FORMAT",
    "KEY",
    "DEST",
    "DRY_RUN",
    "SHARD",
    "ROUNDS",
    "VERSION",
)
SAY_ARGUMENTS = "import json, sys; print(json.dumps(sys.argv[1:]))"


def make(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run make as a user would, whoever runs the tests; `variables` come from the environment.

    The stamps of set-up are given, so that nothing is set up by asking what would be done.
    """
    with TemporaryDirectory() as stamps:
        for group in ("core", "models", "cluster", "stores", "dev"):
            (Path(stamps) / group).touch()
        command = ["make", "--no-print-directory", f"READY={stamps}", *arguments]
        return _run(command, variables)


def _run(command: Sequence[str], variables: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    mine = {name: value for name, value in os.environ.items() if name not in VARIABLES and "MAKE" not in name}
    environment = {**mine, **variables}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


def calls(*arguments: str, **variables: str) -> list[list[str]]:
    """The arguments of every call of Python that make would do."""
    python = f"PYTHON={shlex.join([sys.executable, '-c', SAY_ARGUMENTS])}"
    done = make(python, *arguments, **variables)
    assert done.returncode == 0, done.stderr
    assert not done.stderr, "make must not warn of variables that it was not asked to expand"
    return [json.loads(line) for line in done.stdout.splitlines()]


def nasty(folder: Path) -> str:
    """A value that touches files in `folder` if make or a shell ever reads it."""
    marks = iter(shlex.quote(str(folder / f"ran-{number}")) for number in range(6))
    return (
        f'it\'s "my" model; touch {next(marks)}; `touch {next(marks)}` $(touch {next(marks)}) '
        f"$(shell touch {next(marks)}) $$(touch {next(marks)}) | touch {next(marks)} # $HOME %% \\ * ü"
    )


OPTIONS = ["--config", "c.yaml", "--out", "/data", "--seed", "7", "--workers", "3"]


def test_dataset_is_one_call_and_every_stage_runs_after_its_inputs() -> None:
    given = ("CONFIG=c.yaml", "OUT=/data", "WORKERS=3", "SEED=7")
    assert calls("dataset", *given) == [["-m", "pipeline", "run", *OPTIONS]]
    runs = calls("package", *given)
    assert [run[3] for run in runs] == [
        "autoconfig", "exemplars", "variations", "proportions", "programs", "grammars", "program_sampling",
        "shapeassembly", "string_sampling", "primitives", "mixture", "validity", "abstraction", "strings", "points",
        "sketches", "views", "surface", "structure", "captions", "exports", "package",
    ]  # fmt: skip
    assert all(run == ["-m", "pipeline", "run", run[3], *OPTIONS] for run in runs)


def test_train_names_the_model_that_was_asked_for() -> None:
    assert calls("train", "MODEL=masked-castle", "CONFIG=c.yaml", "OUT=/data", "WORKERS=3", "SEED=7") == [
        ["-m", "pipeline", "train", *OPTIONS, "--only", "masked-castle"]
    ]
    assert not any("--only" in run for run in calls("train"))


def test_recover_reads_the_given_input() -> None:
    (run,) = calls("recover", "PROGRAM=chair", "INPUT=-odd name.ply", "OUT=/data")
    assert run[2:] == [
        "recover", "--out", "/data", "--program", "chair", "--up", "", "--", "-odd name.ply",
    ]  # fmt: skip
    assert make("recover").returncode != 0


def test_export_gets_format_and_keys() -> None:
    (run,) = calls("export", "FORMAT=urdf", "KEY=a-000001,a-000002", "CONFIG=c.yaml", "OUT=/data")
    assert run[2:] == [
        "export", "--config", "c.yaml", "--out", "/data", "--key", "a-000001,a-000002", "--", "urdf",
    ]  # fmt: skip
    assert "make export needs FORMAT=urdf" in make("export").stderr


def test_without_a_seed_the_config_has_its_own() -> None:
    assert "--seed" not in calls("points")[0]


def test_help_lists_every_target_and_every_variable_with_its_value() -> None:
    text = make("help", "OUT=/data", "WORKERS=3").stdout
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.startswith("  ")}
    phony = [
        line for line in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if line.startswith(".PHONY:")
    ]
    targets = {target for line in phony for target in line.split()[1:]}
    assert set(rows) == targets | set(VARIABLES)
    assert all(len(row) > 2 for row in rows.values()), "each is explained"
    values = {name: rows[name][1] for name in VARIABLES}
    assert values == {
        "CONFIG": "configs/default.yaml", "OUT": "/data", "WORK": "-", "WORKERS": "3", "SEED": "-",
        "STALL_TIMEOUT": "-", "CLUSTER": "-", "MESH": "-", "PROGRAM": "-", "INPUT": "-", "UP": "-", "MODEL": "-",
        "TABLE": "-", "PAPER": "-", "SCALE": "minutes", "SAMPLES": "100", "FORMAT": "-", "KEY": "-", "DEST": "-",
        "DRY_RUN": "-", "SHARD": "-", "ROUNDS": "20", "VERSION": "-",
    }  # fmt: skip


def test_every_target_gets_every_value_unchanged(tmp_path: Path) -> None:
    said = nasty(tmp_path)
    targets = (
        "package", "publish", "plan", "status", "verify", "reproduce", "inspect", "eval", "paper", "doctor", "clean",
    )  # fmt: skip
    arguments = [f"{name}={said}" for name in VARIABLES]
    reached = calls(*targets, *arguments)
    assert len(reached) == 22 + len(targets[1:]) + 1, "22 stages; inspect looks at a program and a model"
    assert all(any(said in argument for argument in call) for call in reached)
    assert sum(call.count(said) for call in reached if call[2] == "run") == 22 * 7
    assert make("help", *arguments).stdout.count(said) == len(VARIABLES)
    assert not list(tmp_path.iterdir())


def test_values_from_the_environment_are_as_safe(tmp_path: Path) -> None:
    said = nasty(tmp_path)
    variables = dict.fromkeys(VARIABLES, said)
    assert calls("status", **variables)[0][-1] == said
    assert make("help", **variables).stdout.count(said) == len(VARIABLES)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("target", "variable"), [("status", "CONFIG"), ("inspect", "MESH"), ("inspect", "PROGRAM")])
def test_the_error_names_the_given_file(tmp_path: Path, target: str, variable: str) -> None:
    said = nasty(tmp_path)
    done = make(target, f"{variable}={said}", f"PYTHON={sys.executable}", f"OUT={tmp_path / 'out'}")
    assert done.returncode == 2
    assert said in done.stderr.replace("\\\\", "\\").replace("\\'", "'")
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_inspect_without_a_model_says_what_is_missing() -> None:
    done = make("inspect")
    assert done.returncode == 2
    assert "make inspect needs MESH=my.glb or PROGRAM=chair" in done.stderr
