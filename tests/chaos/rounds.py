"""One round: some shards are taken away, a run that makes them is struck at a moment of its progress, and the next run
must make what an undisturbed one has made."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.chaos.faults import Fault, InjectedFault
from tests.chaos.running import Run
from tests.chaos.sandbox import Sandbox, Step
from tests.chaos.sandboxes import damaged

_EARLY = 0.08
"""Share of the blows that come while the run still starts."""
_ANEW = 0.03
"""Share of the rounds that begin with nothing made."""
_A_SHARD = 0.4
"""Seconds within which a blow comes after the progress that it waits for: a tiny shard takes about so long."""


@dataclass(frozen=True)
class Ended:
    """How a round ended: whether the blow struck (`struck`), came too late (`late`) or found nothing to strike
    (`missed`); the code of the struck run; and words."""

    how: str
    code: int
    words: str


def play(arena: Sandbox, blow: Fault, rng: np.random.Generator) -> Ended:
    """One round. Raises AssertionError where it did not go as it must."""
    first, taken = _take_away(arena, rng)
    steps = arena.steps[arena.steps.index(first) :]
    if blow.edited:
        arena.write_configs(arena.edited[int(rng.integers(len(arena.edited)))])
        steps = arena.steps
    before = arena.written()
    run = arena.start(steps, *blow.options, prepare=blow.prepare)
    in_time = _moment_comes(arena, run, before, taken, blow, rng)
    struck = blow.strike(arena, run, rng) if in_time else InjectedFault("the run was over before", hit=False)
    try:
        code = run.end()
    finally:
        struck.put_right()
        arena.write_configs()
    _check(run, struck, code, blow, arena)
    _check_next(arena, struck)
    how = "struck" if struck.hit else "missed" if in_time else "late"
    words = f"{struck.words}; from {'/'.join(first)} on it ended with {code}, then with 0 and the same bytes"
    return Ended(how, code, words)


def _take_away(arena: Sandbox, rng: np.random.Generator) -> tuple[Step, int]:
    """Take away some shards of a random stage and of one after it, now and then everything; the stage from which on
    there is work, and how many shards are gone."""
    if rng.random() < _ANEW or not all(arena.shards(step) for step in arena.steps):
        arena.begin_anew()
        return arena.steps[0], sum(Path(path).parent.name == "records" for path in arena.calm)
    chosen = sorted({int(index) for index in rng.integers(len(arena.steps), size=2)})
    taken = 0
    for step in (arena.steps[index] for index in chosen):
        shards = arena.shards(step)
        gone: Sequence[str] = list(rng.permutation(shards)[: rng.integers(1, len(shards) + 1)])
        arena.unmake(step, gone)
        taken += len(gone)
    return arena.steps[chosen[0]], taken


def _moment_comes(
    arena: Sandbox, run: Run, before: Mapping[Path, int], taken: int, blow: Fault, rng: np.random.Generator
) -> bool:
    """Wait until the blow is to come: while the run starts, or when so many of the `taken` shards have records again
    and the next is in the making. False where the run was over before."""
    if rng.random() < _EARLY and not blow.needs_worker:
        moment = run.began + rng.uniform(0, 1)
    else:
        recorded = int(rng.integers(max(taken - 1, 1)))

        def far_enough() -> bool:
            return sum(before.get(path) != at for path, at in arena.written().items()) >= recorded

        if not (run.wait(run.look) and run.wait(far_enough) and (not blow.needs_worker or run.wait(run.look))):
            return False
        moment = time.monotonic() + rng.uniform(0, _A_SHARD)
    return run.wait(lambda: time.monotonic() >= moment)


def _check(run: Run, struck: InjectedFault, code: int, blow: Fault, arena: Sandbox) -> None:
    said = run.said()
    assert code in blow.codes or _set_aside(blow, code, said), f"{struck.words}: ended with {code}: {said[-2000:]}"
    _check_words(struck, said)
    assert blow.words.get(code, "") in said, f"{struck.words}: no clear word: {said[-2000:]}"
    if struck.other is not None:
        other, words = struck.other
        assert other in blow.codes, f"{struck.words} ended with {other}: {words[-2000:]}"
        assert 0 in (code, other), f"{struck.words}: neither went through: {said[-1000:]} {words[-1000:]}"
        _check_words(struck, words)
    if not blow.edited:
        half = arena.half_written(struck.spoilt)
        assert not half, f"{struck.words}: half written under a final name: {half[:5]}"


def _set_aside(blow: Fault, code: int, said: str) -> bool:
    """Whether a shard was set aside for want of progress: on a busy machine others are too slow as well."""
    return code == 1 and bool(blow.options) and "it made no progress" in said


def _check_words(struck: InjectedFault, said: str) -> None:
    traced = "Traceback" in said and "KeyboardInterrupt" not in said
    assert not traced, f"{struck.words}: a traceback: {said[-3000:]}"


def _check_next(arena: Sandbox, struck: InjectedFault) -> None:
    """The next run must make what an undisturbed one has made. A spoilt file that no stage reads again is found by
    `make verify` alone, after which the next run mends it."""
    again = arena.start(arena.steps)
    code = again.end()
    assert code == 0, f"{struck.words}: the next run ended with {code}: {again.said()[-2000:]}"
    if struck.spoilt and arena.digests() != arena.calm:
        assert damaged(arena), f"{struck.words}: not found"
        mended = arena.start(arena.steps)
        assert mended.end() == 0, mended.said()[-2000:]
    found = arena.digests()
    other = sorted(path for path in {*found, *arena.calm} if found.get(path) != arena.calm.get(path))
    assert not other, f"{struck.words}: other bytes than undisturbed: {other[:5]}"
