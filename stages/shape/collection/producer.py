"""Who made a sample: a stage that makes samples, and what there is to say of how it does."""

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


def _no_lineage(_: Config) -> Mapping[str, RecordField]:
    return {}


def _no_origins(_: Plan) -> Sequence[Origin]:
    return ()


def _no_measures(_: Plan) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class Producer:
    """A stage that makes samples. `PRODUCER = Producer(...)` stands in `stages/<stage>/producer.py`.

    Its plan has shards of `stages.shape.sample.Sample`, named `<dataset>-<split>-<index>`, whose summaries say `split`
    and `samples`.

    language: the name of the language that its samples are in; keys: the keys of a config that ask for it, for
    messages; asked: whether a config does.
    sentence: how its samples come about; splits: what keeps its splits apart; limits: what not to expect of them, in
    sentences; all for the card. apart: whether samples of one graph always stand in one split.
    lineage: what `Sample.lineage` of its samples holds beside `method` and `parents`, by name; the same fields of the
    same types in all samples of a dataset, and no value empty.
    origins: the files that its samples are made from, and whose they are.
    nearness: Markdown for the card on how near the samples of each split are to train.
    card: paragraphs and tables for the card's section on how the dataset was made, from finished records.
    variety: Markdown for the card's section on how different the samples are.
    measures: figures for the manifest.
    """

    language: str
    keys: str
    asked: Callable[[Config], bool]
    sentence: str
    splits: str
    graphs_share_split: bool
    limits: tuple[str, ...] = ()
    lineage: Callable[[Config], Mapping[str, RecordField]] = _no_lineage
    origins: Callable[[Plan], Sequence[Origin]] = _no_origins
    nearness: Callable[[Plan], Sequence[str]] = _nothing_to_add
    card: Callable[[Plan], Sequence[str]] = _nothing_to_add
    variety: Callable[[Plan], Sequence[str]] = _nothing_to_add
    measures: Callable[[Plan], Mapping[str, Any]] = _no_measures
