"""`make chaos`: rounds of chaos over the real stages, each told with its seed and how it ended.

    python -m tests.chaos [--rounds N] [--seed S] [--only BLOW] [--arena NAME] [--folder FOLDER] [--first ROUND]

A round takes some shards away, runs the stages from there on, strikes when so many shards are made again, and runs all
of them once more.
It is as it must be when the struck run ended with a code that the blow allows and a clear word, left no worker behind
and nothing half-written under a final name, and the next run made what an undisturbed one makes, byte for byte.
At the end stands a table of blows, arenas and endings. Ends with 1 if a round was otherwise; `--first` and the same
seed make that round again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.chaos.faults import BLOWS
from tests.chaos.rounds import play
from tests.chaos.sandbox import Sandbox
from tests.chaos.sandboxes import ARENAS, sandbox_in
from tests.chaos.tally import Tally

DISK = "96m"

ALONE = ["unshare", "--map-root-user", "--mount"]
"""Begins a command that may mount disks, which nobody else sees and which go when it ends."""


def main(arguments: list[str]) -> int:
    """Do the rounds; the exit code."""
    said = _arguments(arguments)
    if not said.inside and _may_mount():
        return subprocess.run([*ALONE, sys.executable, "-m", "tests.chaos", *arguments, "--inside"]).returncode
    with tempfile.TemporaryDirectory(prefix="chaos-") as folder:
        below = said.folder or Path(folder)
        below.mkdir(parents=True, exist_ok=True)
        if said.inside:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "chaos", str(below)], check=True)
        try:
            return _rounds(said, below, said.inside)
        finally:
            if said.inside:
                subprocess.run(["umount", "--lazy", str(below)], check=True)


def _may_mount() -> bool:
    try:
        return not subprocess.run([*ALONE, "mount", "-t", "tmpfs", "none", "/tmp"], capture_output=True).returncode
    except FileNotFoundError:
        return False


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description="rounds of chaos over the real stages")
    parser.add_argument("--rounds", type=int, default=20, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="where the rounds' randomness starts")
    parser.add_argument("--first", type=int, default=0, help="number of the first round")
    parser.add_argument("--only", choices=sorted(BLOWS), nargs="+", default=sorted(BLOWS), help="these blows alone")
    whole = sorted(name for name, item in ARENAS.items() if not item.tests)
    parser.add_argument("--arena", choices=sorted(ARENAS), nargs="+", default=whole, help="these datasets alone")
    parser.add_argument("--folder", type=Path, default=None, help="where to, instead of a temporary folder")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _rounds(said: argparse.Namespace, below: Path, small_disk: bool) -> int:
    kinds = {name: BLOWS[name] for name in said.only if small_disk or not BLOWS[name].needs_disk}
    for name in sorted({*said.only} - {*kinds}):
        print(f"without the blow '{name}': this machine lets nobody mount a small disk", flush=True)
    arenas: dict[str, Sandbox] = {}
    tally = Tally()
    for number in range(said.first, said.first + said.rounds):
        rng = np.random.default_rng((said.seed, number))
        place, name = said.arena[rng.integers(len(said.arena))], sorted(kinds)[rng.integers(len(kinds))]
        start = time.monotonic()
        if place not in arenas:
            arenas[place] = sandbox_in(below / place, place)
            _say(f"{place}: {len(arenas[place].calm)} files, undisturbed", start)
            start = time.monotonic()
        try:
            ended = play(arenas[place], kinds[name], rng)
            tally.add(name, place, ended.how, ended.code)
            words = f"{ended.how}: {ended.words}"
        except AssertionError as error:
            words = f"WRONG: {error}"
            tally.add(name, place, "wrong", None)
            arenas[place].begin_anew()
        _say(f"round {number} of seed {said.seed}: {place}, {name}: {words}", start)
    print("\n".join(tally.lines()), flush=True)
    return int(tally.count(ending="wrong") > 0)


def _say(words: str, start: float) -> None:
    print(f"{words} ({time.monotonic() - start:.0f} s)", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
