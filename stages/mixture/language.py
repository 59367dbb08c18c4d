"""The language of a mixture: each sample is in the language of the producer that made it.

The mixture's own samples, which are edited, have a text that holds the edit and the text of what was edited.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, zip_longest
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.mixture.contrast import NAME, edited, original_record, original_sample
from stages.mixture.settings import MixtureConfig
from stages.shape.arrays import IntArray
from stages.shape.collection.discovery import language_of, languages
from stages.shape.collection.language import Language, RebuildShape, ShapeDecoder, Source
from stages.shape.collection.shards import sample_producers
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright


class MixtureDecoder:
    """Decodes each sample by the language of its producer. Producers of one kit share its source."""

    def __init__(self, decoders: Mapping[str, ShapeDecoder], share_classes: bool) -> None:
        self._decoders = decoders
        self.sources = joined_sources(decoders, share_classes)

    def shape(self, sample: Sample) -> Shape:
        """Return the shape of a sample. Raises what the decoder of its producer raises."""
        if sample.producer == NAME:
            original, edit = original_sample(sample)
            return edited(upright(self.shape(original)), edit)
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
                    f"{made_by[name]} and {producer} both make samples of {name!r}, but with different part labels; "
                    "rename one of them in the config"
                )
            joined.setdefault(name, replace(source, shares_classes=share_classes))
            made_by.setdefault(name, producer)
    return joined


def _reads(plan: Plan) -> tuple[str, ...]:
    read = (language_of(producer).reads(plan) for producer in sample_producers(plan) if producer != NAME)
    return tuple(dict.fromkeys(chain.from_iterable(read)))


def _decoder(task: Task) -> MixtureDecoder:
    makers = [producer for producer in task.shard.params["joined"] if producer != NAME]
    decoders = {producer: language_of(producer).decoder(task) for producer in makers}
    return MixtureDecoder(decoders, task.config.section(MixtureConfig).classes == "label")


def _rebuild(paths: DatasetPaths) -> RebuildShape:
    known = {name: language.rebuild(paths) for name, language in languages().items() if name != NAME}

    def shape(record: Mapping[str, Any], _: IntArray) -> Shape:
        original, edit = original_record(record)
        return edited(known[original["language"]](original, np.empty((0, 2), dtype=np.int32)), edit)

    return shape


LANGUAGE = Language(
    name=NAME,
    reads=_reads,
    decoder=_decoder,
    graphs=False,
    text="The edit of its partner as JSON, with the partner's own text.",
    rebuild=_rebuild,
    coordinates="Those of the sample that was edited.",
)
