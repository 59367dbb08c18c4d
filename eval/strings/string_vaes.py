"""Metrics of string VAEs: reconstruction, sampling of new shapes, and distances in latent graphs.

The sampling methods are those of strings §5.2, the graphs of latent points those of §5.3 and Table 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eval.engine.models import TrainedModel, by_group, over_seeds, trained_models
from eval.engine.table import Cell, ReferenceRow, Table
from pipeline.randomness import decision_rng
from stages.shape.graphs.canonical import graph_digest
from stages.strings.decoder import decode
from stages.training.string_vae.latent_graph import PathFigures, naive_graph, path_figures, search_graph
from stages.training.string_vae.latent_sampling import SAMPLING_TEMPERATURE, sample
from stages.training.string_vae.trained import TrainedStringVae, load_string_vae

MAX_GRAPH_NODES = 1000
"""Of the graphs of latent points (strings Table 2)."""

PUBLISHED = tuple(
    ReferenceRow(
        f"{shapes}, {kind}", "strings, Table 2", {"components": components, "mean": mean, "greatest": greatest}
    )
    for shapes, kind, components, mean, greatest in (
        ("sand castle", "naive", 102, 4.71, 12.17),
        ("sand castle", "search graph", 1, 0.50, 1.09),
        ("moon base", "naive", 30, 2.29, 5.50),
        ("moon base", "search graph", 1, 0.39, 0.55),
        ("greek houses", "naive", 67, 2.55, 11.36),
        ("greek houses", "search graph", 1, 0.31, 0.49),
    )
)


@dataclass(frozen=True)
class Reconstruction:
    """Percentages of what is reconstructed."""

    strings: int
    """Their number."""
    tokens: float
    same: float
    """Strings."""
    graphs: float
    valid: float


@dataclass(frozen=True)
class Sampling:
    """Percentages of a sampling method."""

    searches: int
    """Their number."""
    valid: float
    """Of all decoded strings."""
    found: float
    """Of the searches."""
    unique: float
    """Distinct graphs, of what was found."""
    novel: float
    """Graphs not in train, of the distinct ones."""


def string_vaes(folder: Path) -> list[TrainedModel[TrainedStringVae]]:
    """Load the string VAEs in a folder of published models, by kit, name and seed.

    Raises ConfigError for weights that cannot be read.
    """
    return trained_models(folder, "string_vae", lambda path, _: load_string_vae(path))


def corpus_strings(folder: Path, kit: str, split: str, model: TrainedStringVae) -> list[str]:
    """Return the strings of a published corpus whose length and cycles a model can represent."""
    lines = (folder / f"{kit}-{split}.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if model.is_valid(line)]


def reconstruction(model: TrainedStringVae, strings: Sequence[str]) -> Reconstruction:
    """Encode at least one string, decode the mean greedily, and compare with the string that the decoder targets."""
    decoded = model.decode(model.encode(strings), None)
    right, total, same, graphs, valid = 0, 0, 0, 0, 0
    for target, output in zip(map(model.target_of, strings), decoded, strict=True):
        target_codes, output_codes = _codes(model, target), _codes(model, output)
        right += sum(a == b for a, b in zip(target_codes, output_codes, strict=False))
        total += max(len(target_codes), len(output_codes))
        same += target == output
        if model.is_valid(output):
            valid += 1
            graphs += _graph(model, target) == _graph(model, output)
    count = len(strings)
    return Reconstruction(count, 100 * right / total, 100 * same / count, 100 * graphs / count, 100 * valid / count)


def shape_graphs(model: TrainedStringVae, strings: Iterable[str]) -> set[str]:
    """Return the digests of the shape graphs of strings."""
    return {_graph(model, string) for string in strings}


def sampling(
    model: TrainedStringVae,
    method: str,
    strings: Sequence[str],
    known: set[str],
    searches: int,
    rng: np.random.Generator,
) -> Sampling:
    """Run searches of one sampling method among training strings, whose shape graphs are `known`."""
    results = sample(model, method, strings, searches, rng)
    graphs = [_graph(model, result.string) for result in results if result.string is not None]
    decoded = sum(result.decoded for result in results)
    distinct = set(graphs)
    return Sampling(
        searches=searches,
        valid=100 * sum(result.valid for result in results) / decoded,
        found=100 * len(graphs) / searches,
        unique=100 * len(distinct) / len(graphs) if graphs else 0.0,
        novel=100 * len(distinct - known) / len(distinct) if distinct else 0.0,
    )


def structure(
    model: TrainedStringVae, strings: Sequence[str], rng: np.random.Generator
) -> tuple[int, dict[str, PathFigures]]:
    """Return the number of nodes, and the figures of the naive graph and the search graph.

    A node is a training string that decodes to a valid string, with its latent point; there are at most
    MAX_GRAPH_NODES.
    """
    chosen = [strings[index] for index in rng.permutation(len(strings))[:MAX_GRAPH_NODES].tolist()]
    points = model.encode(chosen)
    decoded = model.decode(points, None)
    valid = [index for index, string in enumerate(decoded) if model.is_valid(string)]
    nodes = [decoded[index] for index in valid]
    if len(nodes) < 2:
        return len(nodes), {}
    graphs = [_graph(model, node) for node in nodes]
    types = len(model.vocabulary.alphabet.tokens)
    histograms = np.array([np.bincount(_codes(model, node), minlength=types + 1)[1 : types + 1] for node in nodes])
    figures = {
        "naive": path_figures(naive_graph([model.vocabulary.codes(node) for node in nodes], graphs, histograms)),
        "search graph": path_figures(search_graph(points[valid], graphs, histograms)),
    }
    return len(nodes), figures


def reconstruction_table(results: Iterable[tuple[TrainedModel[TrainedStringVae], Reconstruction]]) -> Table:
    """Return one row for the models of a name and a kit, over their seeds."""
    columns = ("model", "seeds", "strings", "tokens %", "strings %", "graphs %", "valid %")
    rows = [
        (group, len(seeds), seeds[0].strings, *over_seeds(seeds, ("tokens", "same", "graphs", "valid")))
        for group, seeds in by_group(results).items()
    ]
    notes = (
        "Strings that training has not seen, encoded and decoded greedily. Tokens: equal, at the same position, to the "
        "target string, which is the canonical one of the graph unless the model's `target` is `same`. Graphs: the "
        "string has the same shape graph. Valid: the grammar admits the string.",
    )
    return Table("String VAE: reconstruction", columns, tuple(rows), notes)


def sampling_table(results: Iterable[tuple[TrainedModel[TrainedStringVae], str, Sampling]]) -> Table:
    """Return one row for the models of a name and a kit and a sampling method, over their seeds."""
    columns = ("model", "method", "seeds", "searches", "valid %", "found %", "unique %", "novel %")
    groups: dict[tuple[str, str], list[Sampling]] = {}
    for trained, method, result in results:
        groups.setdefault((trained.group, method), []).append(result)
    rows = [
        (group, method, len(seeds), seeds[0].searches, *over_seeds(seeds, ("valid", "found", "unique", "novel")))
        for (group, method), seeds in groups.items()
    ]
    notes = (
        "Methods of strings §5.2, as published. Prior, gaussian: points drawn from the prior, or from the Gaussian of "
        f"the training strings, decoded once at a temperature of {SAMPLING_TEMPERATURE}. "
        "Valid: of all decoded strings. "
        "Found: searches that end with a valid string other than their start. Unique: distinct shape graphs of these. "
        "Novel: those not in train. The paper has no values; its order is path, linear, perturbation.",
    )
    return Table("String VAE: new shapes by sampling method", columns, tuple(rows), notes)


def structure_table(
    results: Iterable[tuple[TrainedModel[TrainedStringVae], int, Mapping[str, PathFigures]]],
) -> Table:
    """Return one row for each model and latent graph, with the published rows."""
    rows: list[tuple[Cell, ...]] = []
    for trained, nodes, figures in results:
        for kind, paths in figures.items():
            name = f"{trained.folder}, {kind}"
            rows.append((name, nodes, paths.components, paths.mean, paths.greatest))
    notes = (
        "Graphs of latent points of training strings (strings §5.3): connected components, mean and greatest "
        "accumulated weight of the shortest paths. Naive: the 3 nearest strings by edit distance of their tokens. "
        "Search graph: the 4 nearest points. Both join all strings of one shape graph.",
    )
    columns = ("graph", "nodes", "components", "mean", "greatest")
    return Table("String VAE: shortest paths", columns, tuple(rows), notes, PUBLISHED)


def model_rng(seed: int, trained: TrainedModel[TrainedStringVae], decision: str) -> np.random.Generator:
    """Return the random stream of one decision about a model."""
    return decision_rng(seed, "eval", "strings", trained.group, trained.seed, decision)


def _codes(model: TrainedStringVae, string: str) -> list[int]:
    codes: list[int] = model.vocabulary.codes(string).tolist()
    return codes


def _graph(model: TrainedStringVae, string: str) -> str:
    decoded = decode(string, model.vocabulary.alphabet)
    return graph_digest(decoded.types, decoded.edges)
