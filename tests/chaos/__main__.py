"""`make chaos`: rounds of faults over the real stages, each printed with its seed and result.

    python -m tests.chaos [--rounds N] [--seed S] [--only FAULT] [--sandbox NAME] [--folder FOLDER] [--first ROUND]

A round deletes some shards, runs the stages from there on, injects a fault when some shards are rebuilt, and runs all
stages again. The first run must end with an exit code that the fault allows and a clear message, without workers left
behind or half-written files under a final name. The second run must make the expected files, byte for byte. A table of
faults, sandboxes and results ends the output. Exits with 1 if a round failed; `--first` and the same seed repeat it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.chaos.faults import FAULTS
from tests.chaos.rounds import run_round
from tests.chaos.sandbox import Sandbox
from tests.chaos.sandboxes import SANDBOXES, sandbox_in
from tests.chaos.tally import Tally

DISK_SIZE = "96m"

ISOLATED = ["unshare", "--map-root-user", "--mount"]
"""Prefix of a command that may mount disks, which only it sees and which vanish with it."""


def main(arguments: list[str]) -> int:
    """Do the rounds; return the exit code."""
    output = _arguments(arguments)
    if not output.inside and _may_mount():
        return subprocess.run([*ISOLATED, sys.executable, "-m", "tests.chaos", *arguments, "--inside"]).returncode
    with tempfile.TemporaryDirectory(prefix="chaos-") as folder:
        below = output.folder or Path(folder)
        below.mkdir(parents=True, exist_ok=True)
        if output.inside:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK_SIZE}", "chaos", str(below)], check=True)
        try:
            return _rounds(output, below, output.inside)
        finally:
            if output.inside:
                subprocess.run(["umount", "--lazy", str(below)], check=True)


def _may_mount() -> bool:
    try:
        return not subprocess.run([*ISOLATED, "mount", "-t", "tmpfs", "none", "/tmp"], capture_output=True).returncode
    except FileNotFoundError:
        return False


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description="rounds of chaos over the real stages")
    parser.add_argument("--rounds", type=int, default=20, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="where the rounds' randomness starts")
    parser.add_argument("--first", type=int, default=0, help="number of the first round")
    parser.add_argument("--only", choices=sorted(FAULTS), nargs="+", default=sorted(FAULTS), help="these faults alone")
    whole = sorted(name for name, item in SANDBOXES.items() if not item.tests)
    parser.add_argument("--sandbox", choices=sorted(SANDBOXES), nargs="+", default=whole, help="these datasets alone")
    parser.add_argument("--folder", type=Path, default=None, help="where to, instead of a temporary folder")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _rounds(output: argparse.Namespace, below: Path, small_disk: bool) -> int:
    kinds = {name: FAULTS[name] for name in output.only if small_disk or not FAULTS[name].needs_disk}
    for name in sorted({*output.only} - {*kinds}):
        print(f"without the fault '{name}': this machine lets nobody mount a small disk", flush=True)
    sandboxes: dict[str, Sandbox] = {}
    tally = Tally()
    for number in range(output.first, output.first + output.rounds):
        rng = np.random.default_rng((output.seed, number))
        place, name = output.sandbox[rng.integers(len(output.sandbox))], sorted(kinds)[rng.integers(len(kinds))]
        start = time.monotonic()
        if place not in sandboxes:
            sandboxes[place] = sandbox_in(below / place, place)
            _say(f"{place}: {len(sandboxes[place].expected)} files, undisturbed", start)
            start = time.monotonic()
        try:
            ended = run_round(sandboxes[place], kinds[name], rng)
            tally.add(name, place, ended.how, ended.code)
            words = f"{ended.how}: {ended.words}"
        except AssertionError as error:
            words = f"WRONG: {error}"
            tally.add(name, place, "wrong", None)
            sandboxes[place].clear()
        _say(f"round {number} of seed {output.seed}: {place}, {name}: {words}", start)
    print("\n".join(tally.lines()), flush=True)
    return int(tally.count(ending="wrong") > 0)


def _say(words: str, start: float) -> None:
    print(f"{words} ({time.monotonic() - start:.0f} s)", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
