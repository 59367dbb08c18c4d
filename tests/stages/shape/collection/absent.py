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
    """Return the stages by name with all their inputs by name, as the pipeline discovers them."""
    known = {stage.name: stage for stage in stages}
    meant = {"*/producer.py": tuple(producers()), "*/members.py": tuple(members())}
    return {
        name: replace(
            stage,
            inputs=tuple(
                name for asked in stage.inputs for name in meant.get(asked, (asked,)) if asked == name or name in known
            ),
        )
        for name, stage in known.items()
    }
