"""The command line: exit codes, status, verify, and the stages found by their folders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.config import load_config
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.status import status_lines
from tests.pipeline.conftest import WriteConfig, made
from tests.pipeline.toy_run import PACKAGE, run_toy_stages

ROOT = Path(__file__).resolve().parents[2]
WORK = Path(".work/toys")


def shapemill(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.pipeline.toy_run", *(str(argument) for argument in arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_stages_are_found_by_folder_and_ordered_by_inputs() -> None:
    stages = find_stages(PACKAGE)
    assert set(stages) == {"grain", "flour", "salt", "bread"}
    assert [name for name in stages if name != "salt"] == ["grain", "flour", "bread"]


def test_a_file_for_the_datasets_folder_is_refused(tmp_path: Path, write_config: WriteConfig) -> None:
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    done = shapemill("run", "--config", write_config(), "--out", tmp_path / "out")
    assert (done.returncode, "out is a file; name a folder" in done.stderr) == (2, True), done.stderr


def test_run_with_nothing_to_make_loads_no_library_of_workers_and_kernels(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    """So it answers in a second: Numba with the kernels takes half a second, loky a tenth."""
    config = write_config()
    run_toy_stages(config, tmp_path / "out")
    program = (
        "import sys; from pipeline.cli import main; from pipeline.registry import find_stages; find_stages()\n"
        f"sys.argv = ['shapemill', 'run', '--config', {str(config)!r}, '--out', {str(tmp_path / 'out')!r}]\n"
        f"main({PACKAGE!r})"
    )
    command = [sys.executable, "-X", "importtime", "-c", program]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
    assert said.stderr.count("nothing to make") == 4
    imported = {line.rpartition("|")[2].strip() for line in said.stderr.splitlines() if line.startswith("import time")}
    assert "stages.package.settings" in imported
    assert not imported & {"numba", "joblib", "scipy", "torch", "pyarrow", "trimesh"}


def test_run_and_status_show_every_stage(tmp_path: Path, write_config: WriteConfig) -> None:
    options = ("--config", write_config(), "--out", tmp_path / "out")
    assert shapemill("run", "grain", *options, "--workers", 2).returncode == 0
    status = shapemill("status", *options)
    assert status.returncode == 0
    rows = [line.split() for line in status.stdout.splitlines()]
    assert rows[0] == ["stage", "done", "failed", "samples", "rejects", "time", "left", "memory", "disk"]
    by_name = {row[0]: row for row in rows}
    assert by_name["grain"][1:5] == ["6/6", "0", "24", "12"]
    assert by_name["flour"][1:7] == ["0/6", "0", "0", "0", "0s", "?"]
    assert by_name["bread"][1:] == ["waits", "for", "flour"]
    assert "grain: 12 rejected: hollow" in status.stdout


def test_status_leaves_out_stages_that_the_config_does_not_request(tmp_path: Path) -> None:
    stages = find_stages()
    config = load_config(ROOT / "configs" / "chairs.yaml", {name: stage.config for name, stage in stages.items()})
    rows = {line.split()[0]: line.split() for line in status_lines(config, stages, DatasetPaths(tmp_path, "none"), 1)}
    assert rows["programs"][1].startswith("0/")
    assert rows["points"][1:] == ["waits", "for", "programs"]
    assert "package" in rows
    assert not rows.keys() & {"exemplars", "grammars", "mixture", "primitives", "proportions", "variations"}


def test_run_without_a_stage_makes_the_whole_dataset(tmp_path: Path, write_config: WriteConfig) -> None:
    options = ("--config", write_config(), "--out", tmp_path / "whole", "--workers", 2)
    done = shapemill("run", *options)
    assert done.returncode == 0
    run_toy_stages(write_config(), tmp_path / "stages")
    assert made(tmp_path / "whole") == made(tmp_path / "stages")
    fails = shapemill("run", "--config", write_config(flour={"trouble": {"harvest1-1": "fails"}}), *options[2:])
    assert fails.returncode == 1
    assert "flour: failed: harvest1-1" in fails.stderr
    assert "bread" not in fails.stderr, "nothing runs after a stage that failed"


def test_help_groups_the_commands_of_engine_and_rooms_and_imports_nothing_heavy() -> None:
    code = "import sys\ntry: main()\nfinally: print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    command = [sys.executable, "-c", f"from pipeline.cli import main\n{code}", "--help"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    panels = ["Make a dataset", "Look at a dataset, a mesh or a program", "Train models and use them", "Measure"]
    positions = [said.stdout.index(panel) for panel in (*panels, "Machine and project")]
    assert positions == sorted(positions)
    words = said.stdout.split()
    assert all(name in words for name in ("run", "plan", "status", "verify", "inspect", "train", "recover", "eval"))
    imported = said.stdout.splitlines()[-1].split()
    assert not {"numpy", "scipy", "numba", "torch", "trimesh", "joblib"} & set(imported)


def test_status_names_quarantined_shards(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"trouble": {"harvest1-1": "fails"}})
    run_toy_stages(config, tmp_path / "out", "salt", "grain", "flour")
    status = shapemill("status", "--config", config, "--out", tmp_path / "out")
    assert "flour: harvest1-1 is quarantined: the stones are blunt" in status.stdout
    assert [line.split()[1:3] for line in status.stdout.splitlines() if line.startswith("flour ")] == [["5/6", "1"]]


def test_seed_of_the_command_line_replaces_that_of_the_config(tmp_path: Path, write_config: WriteConfig) -> None:
    shapemill("run", "grain", "--config", write_config(), "--out", tmp_path / "asked", "--seed", 11)
    run_toy_stages(write_config(seed=11), tmp_path / "written", "grain")
    assert made(tmp_path / "asked") == made(tmp_path / "written")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "flower"), "there is no stage flower; did you mean flour?"),
        (("run", "flour", "--shards", "3/2"), "--shards 3/2: must be i/n with 1 <= i <= n, such as 2/8"),
        (("run", "flour", "--workers", "0"), "--workers"),
        (("run", "flour", "--config", "none.yaml"), "none.yaml: cannot be read: No such file or directory"),
        (("run", "flour"), "flour reads grain, and 2 of its 2 shards are not made"),
    ],
)
def test_wrong_call_exits_with_2_and_names_the_right_one(
    tmp_path: Path, write_config: WriteConfig, arguments: tuple[str, ...], message: str
) -> None:
    given = arguments if "--config" in arguments else (*arguments, "--config", str(write_config()))
    done = shapemill(*given, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_wrong_config_exits_with_2_before_any_work(tmp_path: Path, write_config: WriteConfig) -> None:
    done = shapemill("run", "salt", "--config", write_config(flour={"finenes": 1.0}), "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "flour.finenes: unknown key; did you mean fineness?" in done.stderr
    assert not (tmp_path / "out").exists()


def test_verify_finds_a_flipped_byte_and_the_next_run_rebuilds_the_shard(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    config, out = write_config(), tmp_path / "out"
    run_toy_stages(config, out)
    whole = made(out)
    options = ("verify", "--config", config, "--out", out)
    good = shapemill(*options, "--samples", 3)
    assert (good.returncode, good.stdout) == (0, "verify toys 3\n")
    loaf = out / "toys/loaves/1.bin"
    content = bytearray(loaf.read_bytes())
    content[100] ^= 1
    with open(loaf, "r+b") as stream:
        stream.write(content)
    bad = shapemill(*options)
    assert bad.returncode == 1
    assert "loaf-harvest0-1.bin is corrupted; the next run rebuilds loaf-harvest0-1" in bad.stdout
    assert run_toy_stages(config, out)["bread"].made == 1
    assert made(out) == whole


def test_verify_of_an_unfinished_dataset_fails(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out", "salt", "grain")
    done = shapemill("verify", "--config", write_config(), "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "flour: 6 of 6 shards are not made, first harvest0-0" in done.stdout


def test_group_of_commands_of_a_room_gets_its_arguments_and_gives_its_exit_code() -> None:
    done = shapemill("inspect", "mesh", "my.glb", "--json")
    assert (done.returncode, done.stdout) == (0, "inspect my.glb True\n")
    assert shapemill("inspect", "mesh", "my.glb", "--fail").returncode == 1
    assert shapemill("inspect", "program", "chair").stdout == "program chair\n"


def test_clean_removes_the_work_and_leaves_the_dataset(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out")
    assert shapemill("clean", "--config", write_config(), "--out", tmp_path / "out").returncode == 0
    assert sorted(path.name for path in (tmp_path / "out").rglob("*") if path.is_file()) == [
        f"{index}.bin" for index in range(4)
    ]
