"""Shapes that models dreamt beside those that the models have learnt from: what is lost, what is won (strings §6)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from eval.engine.table import Cell, Table
from pipeline.paths import DatasetPaths
from pipeline.shards import read_shard
from stages.exemplars.language import LANGUAGE
from stages.shape.arrays import FloatArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.geometry.docking import DockingTable
from stages.shape.graphs.canonical import graph_digest
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.copied_pieces import CopyDetector

COLUMNS = (
    "shapes of",
    "shapes",
    "graphs",
    "parts",
    "cycle rank",
    "histograms",
    "E exemplar",
    "E learnt",
    "copied %",
    "pieces",
    "rooted %",
    "stable %",
    "margin",
)

NOTES = (
    "Learnt: what stands in train of the dataset that the model was trained on. Graphs, histograms: how many different "
    "ones. Parts, cycle rank, pieces, margin: medians. E: histogram "
    "distance (strings §5.3) to the nearest exemplar, and to the nearest other shape that was learnt; medians. Copied: "
    "share of a shape in its largest piece that stands so in an exemplar, median; pieces: how few cover it.",
)


@dataclass(frozen=True)
class Dream:
    """A shape of a finished dataset with what its record says of how it stands."""

    assembly: Assembly
    rooted: bool
    stable: bool
    margin: float


def finished_shapes(folder: Path, places: DatasetPaths, splits: Sequence[str]) -> Iterator[tuple[str, Dream]]:
    """The kit's name and the shape of each sample of these splits of a finished dataset of kits in `folder`, whose
    mill's folders are `places`; of those whose parts are all as the kit has them."""
    anew = LANGUAGE.rebuild(places)
    for split in splits:
        for shard in sorted((folder / "data" / split).glob("*.tar")):
            for _key, members in read_shard(shard):
                record: Mapping[str, Any] = json.loads(members["json"])
                physics = record["physics"]
                shape = anew(record, pairs_of(members[CONTACTS]))
                if not shape.is_stretched:
                    found = Dream(shape.assembly, physics["rooted"], physics["stable"], physics["margin"])
                    yield record["kit"], found


def dream_row(name: str, kit: Kit, dreams: Sequence[Dream], learnt: Sequence[Dream]) -> tuple[Cell, ...]:
    """The row of at least one shape. Where `dreams` are the shapes `learnt` themselves, in the same order, none is its
    own neighbour."""
    shapes = [each.assembly for each in dreams]
    graphs = [graph_digest(each.types, each.edges) for each in shapes]
    themselves = dreams is learnt
    table = DockingTable.of(kit)
    test = CopyDetector(kit, table)
    copied = [test.copied(each, table.label_edges(each.types, each.poses, each.edges)) for each in shapes]
    histograms = _histograms(kit, shapes)
    return (
        name,
        len(shapes),
        len(set(graphs)),
        round(median(len(each) for each in shapes)),
        round(median(len(each.edges) - len(each) + 1 for each in shapes)),
        len(np.unique(histograms, axis=0)),
        _nearest(histograms, _histograms(kit, [each.assembly for each in kit.exemplars]), False),
        _nearest(histograms, _histograms(kit, [each.assembly for each in learnt]), themselves),
        100 * median(each.largest for each in copied),
        round(median(each.pieces for each in copied)),
        100 * fmean(each.rooted for each in dreams),
        100 * fmean(each.stable for each in dreams),
        median(each.margin for each in dreams),
    )


def dreams_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """The rows of `dream_row`."""
    return Table("Dreams beside what they were learnt from", COLUMNS, tuple(rows), NOTES)


def _histograms(kit: Kit, shapes: Sequence[Assembly]) -> FloatArray:
    """How many parts of each type: float64 (shapes, types)."""
    counted = [np.bincount(each.types, minlength=len(kit.types)) for each in shapes]
    return np.array(counted, dtype=np.float64).reshape(-1, len(kit.types))


def _nearest(histograms: FloatArray, others: FloatArray, themselves: bool) -> Cell:
    """The median of E to the nearest."""
    if len(others) <= themselves:
        return ""
    found = []
    for place, each in enumerate(histograms):
        apart = histogram_metric(each, others)
        if themselves:
            apart[place] = np.inf
        found.append(float(apart.min()))
    return median(found)
