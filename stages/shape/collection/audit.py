"""How `make verify` checks what a stage made of a sample."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from pipeline.paths import DatasetPaths
from stages.shape.collection.packaged import PackagedSample


def _nothing(_: PackagedSample) -> Iterator[str]:
    return iter(())


def _no_recheck(_: PackagedSample, __: DatasetPaths) -> Iterator[str]:
    return iter(())


@dataclass(frozen=True)
class Audit:
    """Checks of finished samples, declared as `AUDIT = Audit(...)` in `stages/<stage>/audit.py`.

    No stage imports an audit, so an edited audit rebuilds nothing. A check yields one sentence for each fault of a
    sample.

    faults: cheap check, run on every sample.
    recheck: check that rebuilds what was made, or uses other means, with the intermediate files of the dataset. It is
        run on some samples.
    """

    faults: Callable[[PackagedSample], Iterator[str]] = _nothing
    recheck: Callable[[PackagedSample, DatasetPaths], Iterator[str]] = _no_recheck
