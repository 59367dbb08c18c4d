"""The producers that a dataset of kits does not use, for tests that put stages together by hand."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.config import StrictModel
from pipeline.stage import Outcome, Stage
from stages.shape.collection.shards import PRODUCERS

__all__ = ["ABSENT_SECTIONS", "ABSENT_STAGES"]


class NothingConfig(StrictModel):
    """Nothing to set."""


ABSENT_STAGES: Mapping[str, Stage] = {
    name: Stage(name, __name__, NothingConfig, (), lambda _: [], lambda _: Outcome(0), lambda _: 0)
    for name in PRODUCERS[1:]
}
ABSENT_SECTIONS: Mapping[str, StrictModel] = {name: NothingConfig() for name in ABSENT_STAGES}
