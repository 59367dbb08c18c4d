"""The language of a mixture: each sample is in the language of the producer that made it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, zip_longest
from typing import Any

from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.mixture.settings import MixtureConfig
from stages.shape.arrays import IntArray
from stages.shape.collection.discovery import language_of, languages
from stages.shape.collection.language import Language, RebuildShape, ShapeDecoder, Source
from stages.shape.collection.shards import sample_producers
from stages.shape.sample import Sample
from stages.shape.shape import Shape

NAME = "mixture"


class MixtureDecoder:
    """Decodes each sample by the language of its producer. Producers of one kit share its source."""

    def __init__(self, decoders: Mapping[str, ShapeDecoder], share_classes: bool) -> None:
        self._decoders = decoders
        self.sources = joined_sources(decoders, share_classes)

    def shape(self, sample: Sample) -> Shape:
        """Return the shape of a sample. Raises what the decoder of its producer raises."""
        return self._decoders[sample.producer].shape(sample)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return at most `count` input shapes; the producers take turns, and a shape of one caption is shown once."""
        shown = zip_longest(*(decoder.shown(count) for decoder in self._decoders.values()))
        distinct = {pair[0]: pair for pair in chain.from_iterable(shown) if pair is not None}
        return list(distinct.values())[:count]


def joined_sources(decoders: Mapping[str, ShapeDecoder], share_classes: bool) -> dict[str, Source]:
    """Return the sources of all producers by name. Raises ConfigError for two of one name with other labels."""
    joined: dict[str, Source] = {}
    made_by: dict[str, str] = {}
    for producer, decoder in decoders.items():
        for name, source in decoder.sources.items():
            if name in joined and joined[name].labels != source.labels:
                raise ConfigError(
                    f"{made_by[name]} and {producer} both make samples of {name!r}, with other part labels; rename one "
                    "of them in the config"
                )
            joined.setdefault(name, replace(source, shares_classes=share_classes))
            made_by.setdefault(name, producer)
    return joined


def _reads(plan: Plan) -> tuple[str, ...]:
    read = (language_of(producer).reads(plan) for producer in sample_producers(plan))
    return tuple(dict.fromkeys(chain.from_iterable(read)))


def _decoder(task: Task) -> MixtureDecoder:
    decoders = {producer: language_of(producer).decoder(task) for producer in task.shard.params["joined"]}
    return MixtureDecoder(decoders, task.config.section(MixtureConfig).classes == "label")


def _rebuild(paths: DatasetPaths) -> RebuildShape:
    def shape(record: Mapping[str, Any], contacts: IntArray) -> Shape:
        return languages()[record["language"]].rebuild(paths)(record, contacts)

    return shape


LANGUAGE = Language(name=NAME, reads=_reads, decoder=_decoder, graphs=False, text="", rebuild=_rebuild)
