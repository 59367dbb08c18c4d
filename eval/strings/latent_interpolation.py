"""Ways between two shapes through the latent space of a string VAE, as rows of pictures (strings §5.2, §5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from eval.engine.evaluation import ImageRow
from eval.engine.pictures import shape_picture
from eval.generated.instantiation import attempts
from eval.strings.string_vaes import NODES
from stages.shape.graphs.canonical import graph_digest
from stages.shape.graphs.histograms import histogram_metric
from stages.shape.shape import kit_shape
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import SolverMethod
from stages.strings.decoder import Decoded, decode
from stages.training.string_vae.latent_graph import interpolation, search_graph
from stages.training.string_vae.latent_sampling import linear_points, path_points
from stages.training.string_vae.trained import TrainedStringVae

STOPS = 8
"""Segments of a way along a line or a path; a power of two."""


def journeys(model: TrainedStringVae, strings: Sequence[str], rng: np.random.Generator) -> Mapping[str, list[str]]:
    """Strings on the ways between the two of some training strings that are least alike by their parts, by the name of
    the way: decoded at equal distances on a line, and at the corners of a path along training samples; and for the
    search graph training strings, the nodes of the shortest path. At least two strings of different graphs."""
    chosen = [strings[place] for place in rng.permutation(len(strings))[:NODES].tolist()]
    graphs = [decode(each, model.vocabulary.alphabet) for each in chosen]
    types = len(model.vocabulary.alphabet.tokens)
    histograms = np.array([np.bincount(each.types, minlength=types) for each in graphs])
    first = 0
    second = int(np.argmax(histogram_metric(histograms, histograms[[first]])))
    points = model.encode(chosen)
    names = [graph_digest(each.types, each.edges) for each in graphs]
    nodes = interpolation(search_graph(points, names, histograms), first, second)
    line = linear_points(points[first], points[second], STOPS - 1)
    path = path_points(points[first], points[second], points, STOPS)[1:-1]
    ends = chosen[first], chosen[second]
    return {
        "on a line": [ends[0], *model.decode(line, None), ends[1]],
        "on a path along training samples": [ends[0], *model.decode(path, None), ends[1]],
        "through the search graph": [chosen[node] for node in nodes],
    }


def journey_strips(
    model: TrainedStringVae,
    strings: Sequence[str],
    maker: Instantiator,
    method: SolverMethod,
    folder: str,
    rng: np.random.Generator,
) -> Iterator[ImageRow]:
    """A row of pictures for each way; stops of the graph of the stop before are left out, and those that become no
    shape are told in its title."""
    for way, along in journeys(model, strings, rng).items():
        stops = list(_changing(decode(each, model.vocabulary.alphabet) for each in along if model.is_valid(each)))
        pictures, failed = [], 0
        for stop, found in zip(stops, attempts(maker, stops, method, 0), strict=True):
            if found.good and found.assembly is not None:
                pictures.append((f"{len(stop.types)} parts", shape_picture(kit_shape(maker.kit, found.assembly))))
            else:
                failed += 1
        told = f"; {failed} of {len(stops)} stops become no shape" if failed else ""
        yield ImageRow(f"{folder}, from one shape to another {way}{told}", pictures)


def _changing(graphs: Iterator[Decoded]) -> Iterator[Decoded]:
    """Each graph that is another than the one before it."""
    before = ""
    for graph in graphs:
        digest = graph_digest(graph.types, graph.edges)
        if digest != before:
            yield graph
        before = digest
