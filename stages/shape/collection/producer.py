"""A stage that makes samples, and what the card says about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.shape.collection.members import RecordField
from stages.shape.collection.origin import Origin


def _nothing_to_add(_: Plan) -> Sequence[str]:
    return ()


def _no_limits(_: Config) -> Sequence[str]:
    return ()


def _no_lineage(_: Config) -> Mapping[str, RecordField]:
    return {}


def _no_origins(_: Plan) -> Sequence[Origin]:
    return ()


def _no_measures(_: Plan) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class Producer:
    """A stage that makes samples, declared as `PRODUCER = Producer(...)` in `stages/<stage>/producer.py`.

    Its plan has shards of `stages.shape.sample.Sample`, named `<dataset>-<split>-<index>`, whose summaries hold `split`
    and `samples`.

    language: name of the language of its samples
    joins: whether its samples are those of all other producers that a config asks for
    adds_samples: of one that joins, whether a config asks for samples of its own among them
    keys: config keys that ask for them, for messages
    is_requested: whether a config asks for them
    sentence: how its samples are made, for the card of a config
    splits: what keeps its splits apart, for the card of a config
    graphs_share_split: whether samples of one graph always share a split
    limits: sentences on what not to expect of the samples, for the card of a config
    lineage: fields of `Sample.lineage` in addition to `method` and `parents`, by name; all samples of a dataset have
        the same fields of the same types, and no value is empty
    origins: files that its samples are made from, and who owns them
    nearness: Markdown for the card on how near the samples of val and test are to train
    card: paragraphs and tables for the card's section on how the dataset was made, from finished records
    variety: Markdown for the card's section on how different the samples are
    measures: figures for the manifest
    """

    language: str
    keys: str
    is_requested: Callable[[Config], bool]
    sentence: Callable[[Config], str]
    splits: Callable[[Config], str]
    graphs_share_split: Callable[[Config], bool]
    joins: bool = False
    adds_samples: Callable[[Config], bool] = lambda _: False
    limits: Callable[[Config], Sequence[str]] = _no_limits
    lineage: Callable[[Config], Mapping[str, RecordField]] = _no_lineage
    origins: Callable[[Plan], Sequence[Origin]] = _no_origins
    nearness: Callable[[Plan], Sequence[str]] = _nothing_to_add
    card: Callable[[Plan], Sequence[str]] = _nothing_to_add
    variety: Callable[[Plan], Sequence[str]] = _nothing_to_add
    measures: Callable[[Plan], Mapping[str, Any]] = _no_measures
