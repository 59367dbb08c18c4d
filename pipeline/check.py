"""The mill's own part of `verify`: every byte of every finished shard is what its record says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pipeline.config import Config
from pipeline.places import Places, file_digest
from pipeline.stage import Stage
from pipeline.survey import Survey

__all__ = ["damaged_shards"]


def damaged_shards(config: Config, stages: Mapping[str, Stage], places: Places) -> Iterator[str]:
    """A line for each stage that is unfinished and for each file whose bytes differ from its record.

    The record of a damaged shard is withdrawn, so that the next run makes that shard again and nothing else.
    """
    survey = Survey(config, stages, places)
    for name in stages:
        surveyed = survey.stage(name)
        if surveyed.missing:
            missing = surveyed.missing
            yield f"{name}: {len(missing)} of {len(surveyed.shards)} shards are not made, first {missing[0].name}"
        for shard, record in surveyed.records.items():
            for file, noted in record.files.items():
                if file_digest(surveyed.places.root / file) != noted["sha256"]:
                    (surveyed.places.records / f"{shard}.json").unlink(missing_ok=True)
                    yield f"{name}: {surveyed.places.root / file} is damaged; the next run makes {shard} again"
