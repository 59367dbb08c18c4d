"""Generated shapes compared with training shapes: diversity, novelty, stability (strings §6)."""

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
    "E training",
    "copied %",
    "pieces",
    "rooted %",
    "stable %",
    "margin",
)

NOTES = (
    "Training: the train split of the dataset that the model was trained on. Graphs, histograms: distinct ones. Parts, "
    "cycle rank, pieces, margin: medians. E: histogram distance (strings §5.3) to the nearest exemplar and to the "
    "nearest other training shape, medians. Copied: share of a shape in its largest verbatim piece of an exemplar, "
    "median. Pieces: the fewest verbatim pieces that cover a shape.",
)


@dataclass(frozen=True)
class GeneratedShape:
    """A shape of a finished dataset, with the physics of its record."""

    assembly: Assembly
    rooted: bool
    stable: bool
    margin: float


def finished_shapes(folder: Path, paths: DatasetPaths, splits: Sequence[str]) -> Iterator[tuple[str, GeneratedShape]]:
    """Yield the kit's name and the shape of each sample of some splits; samples with stretched parts are left out.

    folder: a finished dataset; paths: the pipeline's folders of it.
    """
    shape_of = LANGUAGE.rebuild(paths)
    for split in splits:
        for shard in sorted((folder / "data" / split).glob("*.tar")):
            for _key, members in read_shard(shard):
                record: Mapping[str, Any] = json.loads(members["json"])
                physics = record["physics"]
                shape = shape_of(record, pairs_of(members[CONTACTS]))
                if not shape.is_stretched:
                    yield (
                        record["kit"],
                        GeneratedShape(shape.assembly, physics["rooted"], physics["stable"], physics["margin"]),
                    )


def generated_row(
    name: str, kit: Kit, shapes: Sequence[GeneratedShape], training: Sequence[GeneratedShape]
) -> tuple[Cell, ...]:
    """Return the row of at least one shape. If `shapes` is `training` itself, no shape is its own neighbour."""
    assemblies = [shape.assembly for shape in shapes]
    graphs = [graph_digest(assembly.types, assembly.edges) for assembly in assemblies]
    table = DockingTable.of(kit)
    test = CopyDetector(kit, table)
    copied = [
        test.copied(assembly, table.label_edges(assembly.types, assembly.poses, assembly.edges))
        for assembly in assemblies
    ]
    histograms = _histograms(kit, assemblies)
    exemplars = _histograms(kit, [exemplar.assembly for exemplar in kit.exemplars])
    trained = _histograms(kit, [shape.assembly for shape in training])
    return (
        name,
        len(shapes),
        len(set(graphs)),
        round(median(len(assembly) for assembly in assemblies)),
        round(median(len(assembly.edges) - len(assembly) + 1 for assembly in assemblies)),
        len(np.unique(histograms, axis=0)),
        _nearest(histograms, exemplars, False),
        _nearest(histograms, trained, shapes is training),
        100 * median(copy.largest for copy in copied),
        round(median(copy.pieces for copy in copied)),
        100 * fmean(shape.rooted for shape in shapes),
        100 * fmean(shape.stable for shape in shapes),
        median(shape.margin for shape in shapes),
    )


def generated_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """Return the table of rows of `generated_row`."""
    return Table("Generated shapes and training shapes", COLUMNS, tuple(rows), NOTES)


def _histograms(kit: Kit, shapes: Sequence[Assembly]) -> FloatArray:
    """Count the parts of each type, float64 (shapes, types)."""
    counts = [np.bincount(shape.types, minlength=len(kit.types)) for shape in shapes]
    return np.array(counts, dtype=np.float64).reshape(-1, len(kit.types))


def _nearest(histograms: FloatArray, others: FloatArray, is_same: bool) -> Cell:
    """Return the median E to the nearest of others; with `is_same` both are equal, and no row is its own neighbour."""
    if len(others) <= is_same:
        return ""
    nearest = []
    for row, histogram in enumerate(histograms):
        distances = histogram_metric(histogram, others)
        if is_same:
            distances[row] = np.inf
        nearest.append(float(distances.min()))
    return median(nearest)
