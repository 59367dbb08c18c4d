"""The producers that a dataset of kits does not use, for tests that put stages together by hand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from pipeline.config import StrictModel
from pipeline.stage import Outcome, Stage
from stages.shape.collection.discovery import members, producers


class NothingConfig(StrictModel):
    """Nothing to set."""


ABSENT_STAGES: Mapping[str, Stage] = {
    name: Stage(name, __name__, NothingConfig, (), lambda _: [], lambda _: Outcome(0), lambda _: 0)
    for name in producers()
    if name != "variations"
}
ABSENT_SECTIONS: Mapping[str, StrictModel] = {name: NothingConfig() for name in ABSENT_STAGES}


def named_inputs(stages: Iterable[Stage]) -> dict[str, Stage]:
    """The stages by name, with all inputs by name, as the mill finds them; of those that may be, the ones that are."""
    known = {stage.name: stage for stage in stages}
    meant = {"*/producer.py": tuple(producers()), "*/members.py": tuple(members())}
    return {
        name: replace(
            stage,
            inputs=tuple(
                each for asked in stage.inputs for each in meant.get(asked, (asked,)) if asked == each or each in known
            ),
        )
        for name, stage in known.items()
    }
