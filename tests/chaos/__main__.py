"""`make chaos`: rounds of chaos over the real stages, each told with its seed and how it ended.

    python -m tests.chaos [--rounds N] [--seed S] [--only BLOW] [--arena NAME] [--folder FOLDER] [--first ROUND]

A round takes some shards away, runs the stages from there on, strikes at a random moment, and runs all of them again.
It is as it must be when the struck run ended with a code that the blow allows and a clear word, left no worker behind
and nothing half-written under a final name, and the next run made what an undisturbed one makes, byte for byte.
Ends with 1 if a round was otherwise; `--first` and the same seed make that round again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.chaos.arena import Arena, Run
from tests.chaos.arenas import ARENAS, arena_in, damaged
from tests.chaos.blows import BLOWS, Blow, Struck, edits

DISK = "64m"

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
    whole = sorted({*ARENAS} - {"texts"})
    parser.add_argument("--arena", choices=sorted(ARENAS), nargs="+", default=whole, help="these datasets alone")
    parser.add_argument("--folder", type=Path, default=None, help="where to, instead of a temporary folder")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _rounds(said: argparse.Namespace, below: Path, small_disk: bool) -> int:
    kinds = {name: BLOWS[name] for name in said.only if small_disk or not BLOWS[name].needs_disk}
    for name in sorted({*said.only} - {*kinds}):
        print(f"without the blow '{name}': this machine lets nobody mount a small disk", flush=True)
    arenas = []
    for name in said.arena:
        start = time.monotonic()
        arenas.append(arena_in(below / name, name))
        print(f"{name}: {len(arenas[-1].calm)} files, undisturbed in {time.monotonic() - start:.0f} s", flush=True)
    ended: Counter[str] = Counter()
    for number in range(said.first, said.first + said.rounds):
        rng = np.random.default_rng((said.seed, number))
        arena, name = arenas[rng.integers(len(arenas))], sorted(kinds)[rng.integers(len(kinds))]
        start = time.monotonic()
        try:
            outcome = _round(arena, kinds[name], rng)
            ended["late" if outcome.startswith("late") else "as it must"] += 1
        except AssertionError as error:
            outcome = f"WRONG: {error}"
            ended["wrong"] += 1
            arena.begin_anew()
        words = f"round {number} of seed {said.seed}: {arena.name}, {name}: {outcome}"
        print(f"{words} ({time.monotonic() - start:.0f} s)", flush=True)
    print(", ".join(f"{count} {how}" for how, count in ended.items()), flush=True)
    return int(bool(ended["wrong"]))


def _round(arena: Arena, blow: Blow, rng: np.random.Generator) -> str:
    """One round; how it went. Raises AssertionError where it did not go as it must."""
    stage = _take_away(arena, rng)
    stages = arena.stages[arena.stages.index(stage) :]
    if blow.edited:
        arena.write_config(**edits(rng))
    run = arena.start(stages, *blow.options, prepare=blow.prepare)
    early = rng.random() < 0.15 and not blow.needs_worker
    in_time = early or run.wait(run.look)
    moment = time.monotonic() + rng.uniform(0, 1.5 if early else arena.busy)
    in_time = run.wait(lambda: time.monotonic() >= moment) and in_time
    struck = blow.strike(arena, run, rng) if in_time else Struck("the run was over before")
    try:
        code = run.end()
    finally:
        struck.put_right()
        arena.write_config()
    _check(run, struck, code, blow, arena)
    if not in_time:
        struck = replace(struck, words="late: " + struck.words)
        arena.busy = 0.7 * arena.busy
    elif code == 0 and run.at_work is not None:
        arena.busy = time.monotonic() - run.at_work
    again = arena.start(arena.stages)
    code_again = again.end()
    assert code_again == 0, f"{struck.words}: the next run ended with {code_again}: {again.said()[-2000:]}"
    _check_whole(arena, struck)
    return f"{struck.words}; from {stage} on it ended with {code}, then with 0 and the same bytes"


def _take_away(arena: Arena, rng: np.random.Generator) -> str:
    """Take away some shards of a random stage, now and then everything; the stage from which on there is work."""
    if rng.random() < 0.04 or not arena.shards(arena.stages[-1]):
        arena.begin_anew()
        return arena.stages[0]
    stage = arena.stages[int(rng.integers(len(arena.stages)))]
    shards = arena.shards(stage)
    arena.unmake(stage, list(rng.permutation(shards)[: rng.integers(1, len(shards) + 1)]))
    return stage


def _check(run: Run, struck: Struck, code: int, blow: Blow, arena: Arena) -> None:
    said = run.said()
    assert code in blow.codes or _set_aside(blow, code, said), f"{struck.words}: ended with {code}: {said[-2000:]}"
    _check_words(struck, said)
    if code == 3:
        assert "stopped: " in said, f"{struck.words}: no clear word: {said[-2000:]}"
    if struck.other is not None:
        other, words = struck.other
        assert other in blow.codes, f"{struck.words} ended with {other}: {words[-2000:]}"
        assert 0 in (code, other), f"{struck.words}: neither went through: {said[-1000:]} {words[-1000:]}"
        _check_words(struck, words)
    if not blow.edited:
        half = arena.half_written(struck.spoilt)
        assert not half, f"{struck.words}: half written under a final name: {half[:5]}"


def _set_aside(blow: Blow, code: int, said: str) -> bool:
    """Whether a shard was set aside for want of progress: on a busy machine others are too slow as well."""
    return code == 1 and bool(blow.options) and "it made no progress" in said


def _check_words(struck: Struck, said: str) -> None:
    traced = "Traceback" in said and "KeyboardInterrupt" not in said
    assert not traced, f"{struck.words}: a traceback: {said[-3000:]}"


def _check_whole(arena: Arena, struck: Struck) -> None:
    """What is there must be what an undisturbed run has made. A spoilt file that no stage reads again is found by
    `make verify` alone, after which the next run mends it."""
    if struck.spoilt and arena.digests() != arena.calm:
        assert damaged(arena), f"{struck.words}: not found"
        mended = arena.start(arena.stages)
        assert mended.end() == 0, mended.said()[-2000:]
    found = arena.digests()
    other = sorted(path for path in {*found, *arena.calm} if found.get(path) != arena.calm.get(path))
    assert not other, f"{struck.words}: other bytes than undisturbed: {other[:5]}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
