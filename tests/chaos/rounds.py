"""One round: delete some shards, inject a fault into the run that rebuilds them, and compare the next run's files."""

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

_EARLY_SHARE = 0.08
"""Share of the faults that are injected while the run starts."""
_EMPTY_START_SHARE = 0.03
"""Share of the rounds that begin without any files."""
_SHARD_SECONDS = 0.4
"""Delay of a fault after the progress that it waits for: about the time of a tiny shard."""


@dataclass(frozen=True)
class RoundResult:
    """Result of a round.

    how: `injected`; `late`, the run was over; `missed`, nothing to break
    code: exit code of the run
    """

    how: str
    code: int
    words: str


def run_round(sandbox: Sandbox, fault: Fault, rng: np.random.Generator) -> RoundResult:
    """Do one round. Raises AssertionError where a guarantee is broken."""
    first, taken = _delete_shards(sandbox, rng)
    steps = sandbox.steps[sandbox.steps.index(first) :]
    if fault.edited:
        sandbox.write_configs(sandbox.edited[int(rng.integers(len(sandbox.edited)))])
        steps = sandbox.steps
    before = sandbox.written()
    run = sandbox.start(steps, *fault.options, prepare=fault.prepare)
    in_time = _moment_comes(sandbox, run, before, taken, fault, rng)
    injected = fault.inject(sandbox, run, rng) if in_time else InjectedFault("the run was over before", hit=False)
    try:
        code = run.end()
    finally:
        injected.put_right()
        sandbox.write_configs()
    _check(run, injected, code, fault, sandbox)
    _check_next(sandbox, injected)
    how = "injected" if injected.hit else "missed" if in_time else "late"
    words = f"{injected.words}; from {'/'.join(first)} on it ended with {code}, then with 0 and the same bytes"
    return RoundResult(how, code, words)


def _delete_shards(sandbox: Sandbox, rng: np.random.Generator) -> tuple[Step, int]:
    """Delete some shards of two random stages, now and then everything.

    Returns the first stage with work, and the number of deleted shards.
    """
    if rng.random() < _EMPTY_START_SHARE or not all(sandbox.shards(step) for step in sandbox.steps):
        sandbox.clear()
        return sandbox.steps[0], sum(Path(path).parent.name == "records" for path in sandbox.expected)
    chosen = sorted({int(index) for index in rng.integers(len(sandbox.steps), size=2)})
    taken = 0
    for step in (sandbox.steps[index] for index in chosen):
        shards = sandbox.shards(step)
        gone: Sequence[str] = list(rng.permutation(shards)[: rng.integers(1, len(shards) + 1)])
        sandbox.delete_shards(step, gone)
        taken += len(gone)
    return sandbox.steps[chosen[0]], taken


def _moment_comes(
    sandbox: Sandbox, run: Run, before: Mapping[Path, int], taken: int, fault: Fault, rng: np.random.Generator
) -> bool:
    """Wait for the moment of the fault: at the start, or when some of the `taken` shards have records again.

    Returns False where the run was over before.
    """
    if rng.random() < _EARLY_SHARE and not fault.needs_worker:
        moment = run.began + rng.uniform(0, 1)
    else:
        recorded = int(rng.integers(max(taken - 1, 1)))

        def far_enough() -> bool:
            return sum(before.get(path) != at for path, at in sandbox.written().items()) >= recorded

        if not (run.wait(run.look) and run.wait(far_enough) and (not fault.needs_worker or run.wait(run.look))):
            return False
        moment = time.monotonic() + rng.uniform(0, _SHARD_SECONDS)
    return run.wait(lambda: time.monotonic() >= moment)


def _check(run: Run, injected: InjectedFault, code: int, fault: Fault, sandbox: Sandbox) -> None:
    output = run.output()
    assert code in fault.codes or _stalled(fault, code, output), (
        f"{injected.words}: ended with {code}: {output[-2000:]}"
    )
    _check_words(injected, output)
    assert fault.words.get(code, "") in output, f"{injected.words}: no clear word: {output[-2000:]}"
    if injected.other is not None:
        other, words = injected.other
        assert other in fault.codes, f"{injected.words} ended with {other}: {words[-2000:]}"
        assert 0 in (code, other), f"{injected.words}: neither succeeded: {output[-1000:]} {words[-1000:]}"
        _check_words(injected, words)
    if not fault.edited:
        half = sandbox.half_written(injected.corrupted)
        assert not half, f"{injected.words}: half written under a final name: {half[:5]}"


def _stalled(fault: Fault, code: int, output: str) -> bool:
    """Whether a shard was quarantined without progress: on a busy machine, other shards can stall as well."""
    return code == 1 and bool(fault.options) and "it made no progress" in output


def _check_words(injected: InjectedFault, output: str) -> None:
    traced = "Traceback" in output and "KeyboardInterrupt" not in output
    assert not traced, f"{injected.words}: a traceback: {output[-3000:]}"


def _check_next(sandbox: Sandbox, injected: InjectedFault) -> None:
    """Check that the next run makes the expected files, and that `make verify` finds corrupted ones that none reads."""
    again = sandbox.start(sandbox.steps)
    code = again.end()
    assert code == 0, f"{injected.words}: the next run ended with {code}: {again.output()[-2000:]}"
    if injected.corrupted and sandbox.digests() != sandbox.expected:
        assert damaged(sandbox), f"{injected.words}: not found"
        mended = sandbox.start(sandbox.steps)
        assert mended.end() == 0, mended.output()[-2000:]
    found = sandbox.digests()
    other = sorted(path for path in {*found, *sandbox.expected} if found.get(path) != sandbox.expected.get(path))
    assert not other, f"{injected.words}: other bytes than undisturbed: {other[:5]}"
