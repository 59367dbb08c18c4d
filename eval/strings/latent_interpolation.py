"""Latent interpolation between two shapes of a string VAE, as rows of pictures (strings §5.2, §5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from eval.engine.evaluation import ImageRow
from eval.engine.pictures import rendered_png
from eval.generated.instantiation import attempts
from eval.strings.string_vaes import MAX_GRAPH_NODES
from stages.shape.graphs.canonical import graph_digest
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.shape import kit_shape
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import SolverMethod
from stages.strings.decoder import Decoded, decode
from stages.training.string_vae.latent_graph import interpolation, search_graph
from stages.training.string_vae.latent_sampling import linear_points, path_points
from stages.training.string_vae.trained import TrainedStringVae

NUM_SEGMENTS = 8
"""Of a line or path; a power of two."""


def interpolations(
    model: TrainedStringVae, strings: Sequence[str], rng: np.random.Generator
) -> Mapping[str, list[str]]:
    """Interpolate between the two least similar of some training strings, by their part histograms.

    Return the strings along each way, by its name: decoded at equal distances on a line; at the corners of a path along
    training samples; and, for the search graph, the training strings on its shortest path. `strings` must have at least
    two different graphs.
    """
    chosen = [strings[index] for index in rng.permutation(len(strings))[:MAX_GRAPH_NODES].tolist()]
    graphs = [decode(string, model.vocabulary.alphabet) for string in chosen]
    types = len(model.vocabulary.alphabet.tokens)
    histograms = np.array([np.bincount(graph.types, minlength=types) for graph in graphs])
    first = 0
    second = int(np.argmax(histogram_metric(histograms, histograms[[first]])))
    points = model.encode(chosen)
    digests = [graph_digest(graph.types, graph.edges) for graph in graphs]
    nodes = interpolation(search_graph(points, digests, histograms), first, second)
    line = linear_points(points[first], points[second], NUM_SEGMENTS - 1)
    path = path_points(points[first], points[second], points, NUM_SEGMENTS)[1:-1]
    ends = chosen[first], chosen[second]
    return {
        "on a line": [ends[0], *model.decode(line, None), ends[1]],
        "on a path along training samples": [ends[0], *model.decode(path, None), ends[1]],
        "through the search graph": [chosen[node] for node in nodes],
    }


def interpolation_rows(
    model: TrainedStringVae,
    strings: Sequence[str],
    instantiator: Instantiator,
    method: SolverMethod,
    folder: str,
    rng: np.random.Generator,
) -> Iterator[ImageRow]:
    """Yield a row of pictures for each interpolation, without repeated graphs; titles count failed instantiations."""
    for name, along in interpolations(model, strings, rng).items():
        decoded = (decode(string, model.vocabulary.alphabet) for string in along if model.is_valid(string))
        stops = list(_without_repeats(decoded))
        pictures, failed = [], 0
        for stop, attempt in zip(stops, attempts(instantiator, stops, method, 0), strict=True):
            if attempt.is_valid and attempt.assembly is not None:
                shape = kit_shape(instantiator.kit, attempt.assembly)
                pictures.append((f"{len(stop.types)} parts", rendered_png(shape)))
            else:
                failed += 1
        failures = f"; {failed} of {len(stops)} stops become no shape" if failed else ""
        yield ImageRow(f"{folder}, from one shape to another {name}{failures}", pictures)


def _without_repeats(graphs: Iterator[Decoded]) -> Iterator[Decoded]:
    """Yield each graph that differs from the one before it."""
    before = ""
    for graph in graphs:
        digest = graph_digest(graph.types, graph.edges)
        if digest != before:
            yield graph
        before = digest
