"""How `make verify` looks at what a folder of the house has made of a sample."""

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
    """What is asked of finished samples. `AUDIT = Audit(...)` stands in `stages/<stage>/audit.py`, which no stage
    imports: an edited audit makes nothing anew.

    Each answers a sentence for each fault of a sample, none for one that it has nothing to say of. faults: cheap enough
    to be asked of every sample; anew: by making again what was made, or by other means, with what the mill's folders of
    the dataset still hold; asked of some samples.
    """

    faults: Callable[[PackagedSample], Iterator[str]] = _nothing
    recheck: Callable[[PackagedSample, DatasetPaths], Iterator[str]] = _no_recheck
