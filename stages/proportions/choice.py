"""Which of the shapes that searches found become samples: all layouts in turn, the most different shapes of each."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.text import Proportions, ProportionShapes, Unwarped, read_proportions
from stages.rows.changes import change_json
from stages.shape.arrays import FloatArray
from stages.shape.graphs.canonical import graph_digest


def chosen_texts(
    shapes: ProportionShapes, texts: Sequence[str], count: int, min_difference: float
) -> list[tuple[str, str]]:
    """Return at most `count` texts of one exemplar, each with the digest of its shape graph."""
    groups = _by_layout(shapes, texts)
    order = _most_different([unwarped for unwarped, _ in groups])
    quotas = [len(range(place, count, len(groups))) for place in range(len(groups))]
    chosen: list[list[str]] = []
    for quota, index in zip(quotas, order, strict=True):
        unwarped, own = groups[index]
        distinct = DistinctWarps(unwarped.lattice, min_difference if len(groups) == 1 else 0.0)
        for text in own:
            distinct.add(read_proportions(text).warp)
        # A layout that gives one sample gives a typical one, not the most extreme.
        picked = distinct.farthest_first(quota) if quota > 1 or len(groups) == 1 else list(range(len(own)))[:quota]
        if not picked and quota and unwarped.layout is not None:
            picked = [0]  # other rows alone make it new
        chosen.append([own[number] for number in picked])
    digests = [_digest(shapes, groups[index][0]) for index in order]
    return [(text, digest) for picked, digest in zip(chosen, digests, strict=True) for text in picked]


def _by_layout(shapes: ProportionShapes, texts: Sequence[str]) -> list[tuple[Unwarped, list[str]]]:
    """Return the layouts of texts with the texts of each, in order of appearance.

    Layouts that look the same are one, unless parts that are off by a tolerance give one of them more intervals.
    """
    read: dict[tuple[bytes, tuple[int, ...]], tuple[Unwarped, list[str]]] = {}
    keys: dict[str, tuple[bytes, tuple[int, ...]]] = {}
    for text in texts:
        proportions = read_proportions(text)
        changes = _changes_key(proportions)
        if changes not in keys:
            unwarped = shapes.unwarped(proportions.exemplar, proportions.changes)
            intervals = tuple(len(lengths) for lengths in unwarped.lattice.lengths)
            keys[changes] = b"" if unwarped.layout is None else unwarped.layout.key, intervals
            read.setdefault(keys[changes], (unwarped, []))
        read[keys[changes]][1].append(text)
    return list(read.values())


def _changes_key(proportions: Proportions) -> str:
    return json.dumps([change_json(change) for change in proportions.changes])


def _most_different(layouts: Sequence[Unwarped]) -> list[int]:
    """Return the order of layouts, the most different from those before first, by counts of types and by size."""
    if len(layouts) < 2:
        return list(range(len(layouts)))
    last_type = max(int(layout.assembly.types.max()) for layout in layouts)
    features = np.stack([_features(layout, last_type) for layout in layouts])
    features = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-9)
    gaps = np.linalg.norm(features, axis=1)
    order: list[int] = []
    while len(order) < len(layouts):
        index = int(gaps.argmax())
        order.append(index)
        gaps = np.minimum(gaps, np.linalg.norm(features - features[index], axis=1))
        gaps[order] = -1.0
    return order


def _features(layout: Unwarped, last_type: int) -> FloatArray:
    counts = np.bincount(layout.assembly.types, minlength=last_type + 1)
    sides = np.log(np.maximum(layout.lattice.sides, 1e-12))
    features: FloatArray = np.concatenate([np.log1p(counts), sides])
    return features


def _digest(shapes: ProportionShapes, unwarped: Unwarped) -> str:
    """Return the digest of a layout's graph; of an exemplar as it is without hubs."""
    if unwarped.layout is None:
        (exemplar,) = [exemplar for exemplar in shapes.kit.exemplars if shapes.unwarped(exemplar.name, ()) is unwarped]
        graph = shapes.kit.labelled(exemplar.assembly)
    else:
        graph = shapes.kit.labelled(unwarped.assembly)
    return graph_digest(graph.types, graph.edges)
