"""What string VAEs have learnt: do strings come back, how many new shapes are found, how far apart are they?

The ways of sampling are those of strings §5.2, the graphs of latent points those of §5.3 and Table 2.
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

NODES = 1000
"""Nodes of the graphs of latent points (strings Table 2)."""

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
    """Shares in percent of tokens, strings and graphs that came back where they were; of valid strings."""

    strings: int
    tokens: float
    same: float
    graphs: float
    valid: float


@dataclass(frozen=True)
class Sampling:
    """Shares in percent: valid, of all strings decoded; found, of the searches; unique, distinct graphs of what was
    found; novel, of these those that are not in train."""

    searches: int
    valid: float
    found: float
    unique: float
    novel: float


def string_vaes(folder: Path) -> list[TrainedModel[TrainedStringVae]]:
    """The string VAEs in a folder of published models, by kit, name and seed. Raises ConfigError for weights that are
    not what they should be."""
    return trained_models(folder, "string_vae", lambda path, _: load_string_vae(path))


def corpus_strings(folder: Path, kit: str, split: str, model: TrainedStringVae) -> list[str]:
    """The strings of a published corpus that a model can read: no longer than those it knows, and no more cycles."""
    lines = (folder / f"{kit}-{split}.txt").read_text().splitlines()
    return [each for each in lines if model.is_valid(each)]


def reconstruction(model: TrainedStringVae, strings: Sequence[str]) -> Reconstruction:
    """Encode strings, at least one, and decode the means, the likeliest token each time.

    What comes back is held against what the decoder has learnt to write for the string.
    """
    decoded = model.decode(model.encode(strings), None)
    right, total, same, graphs, valid = 0, 0, 0, 0, 0
    for one, other in zip(map(model.target_of, strings), decoded, strict=True):
        first, second = _codes(model, one), _codes(model, other)
        right += sum(a == b for a, b in zip(first, second, strict=False))
        total += max(len(first), len(second))
        same += one == other
        if model.is_valid(other):
            valid += 1
            graphs += _graph(model, one) == _graph(model, other)
    count = len(strings)
    return Reconstruction(count, 100 * right / total, 100 * same / count, 100 * graphs / count, 100 * valid / count)


def shape_graphs(model: TrainedStringVae, strings: Iterable[str]) -> set[str]:
    """The shape graphs that strings stand for, by their digests."""
    return {_graph(model, each) for each in strings}


def sampling(
    model: TrainedStringVae, way: str, strings: Sequence[str], known: set[str], searches: int, rng: np.random.Generator
) -> Sampling:
    """`searches` searches of one of WAYS among training strings, whose shape graphs are `known`."""
    found = sample(model, way, strings, searches, rng)
    graphs = [_graph(model, each.string) for each in found if each.string is not None]
    asked = sum(each.decoded for each in found)
    distinct = set(graphs)
    return Sampling(
        searches=searches,
        valid=100 * sum(each.valid for each in found) / asked,
        found=100 * len(graphs) / searches,
        unique=100 * len(distinct) / len(graphs) if graphs else 0.0,
        novel=100 * len(distinct - known) / len(distinct) if distinct else 0.0,
    )


def structure(
    model: TrainedStringVae, strings: Sequence[str], rng: np.random.Generator
) -> tuple[int, dict[str, PathFigures]]:
    """How many nodes, and the figures of the naive and the search graph of at most NODES training strings.

    A node is the point of a training string that decodes to a valid string, and that string.
    """
    chosen = [strings[place] for place in rng.permutation(len(strings))[:NODES].tolist()]
    points = model.encode(chosen)
    decoded = model.decode(points, None)
    valid = [place for place, each in enumerate(decoded) if model.is_valid(each)]
    nodes = [decoded[place] for place in valid]
    if len(nodes) < 2:
        return len(nodes), {}
    graphs = [_graph(model, each) for each in nodes]
    types = len(model.vocabulary.alphabet.tokens)
    histograms = np.array([np.bincount(_codes(model, each), minlength=types + 1)[1 : types + 1] for each in nodes])
    figures = {
        "naive": path_figures(naive_graph([model.vocabulary.codes(each) for each in nodes], graphs, histograms)),
        "search graph": path_figures(search_graph(points[valid], graphs, histograms)),
    }
    return len(nodes), figures


def reconstruction_table(found: Iterable[tuple[TrainedModel[TrainedStringVae], Reconstruction]]) -> Table:
    """One row for the models of a name and a kit, over their seeds."""
    columns = ("model", "seeds", "strings", "tokens %", "strings %", "graphs %", "valid %")
    rows = [
        (group, len(each), each[0].strings, *over_seeds(each, ("tokens", "same", "graphs", "valid")))
        for group, each in by_group(found).items()
    ]
    notes = (
        "Strings that training has not seen, encoded and decoded, the likeliest token each time. Tokens: the same at "
        "the same place as in the string that was to be written, which is the canonical one of its graph unless the "
        "model's `target` is `same`; graphs: the string stands for the same shape graph; valid: the grammar admits it.",
    )
    return Table("String VAE: reconstruction", columns, tuple(rows), notes)


def sampling_table(found: Iterable[tuple[TrainedModel[TrainedStringVae], str, Sampling]]) -> Table:
    """One row for the models of a name and a kit and a way, over their seeds."""
    columns = ("model", "way", "seeds", "searches", "valid %", "found %", "unique %", "novel %")
    groups: dict[tuple[str, str], list[Sampling]] = {}
    for trained, way, each in found:
        groups.setdefault((trained.group, way), []).append(each)
    rows = [
        (group, way, len(each), each[0].searches, *over_seeds(each, ("valid", "found", "unique", "novel")))
        for (group, way), each in groups.items()
    ]
    notes = (
        "Ways of strings §5.2, each as published; prior, gaussian: points drawn from the prior, or from the Gaussian "
        f"of the training strings, decoded once at token temperature {SAMPLING_TEMPERATURE}. Valid: of all strings "
        "that were decoded. Found: searches that end with a valid string other than where they began. Unique: distinct "
        "shape graphs of what was found; novel: of these not in train. "
        "The paper has no figures; its order is path, linear, perturbation.",
    )
    return Table("String VAE: new shapes by way of sampling", columns, tuple(rows), notes)


def structure_table(found: Iterable[tuple[TrainedModel[TrainedStringVae], int, Mapping[str, PathFigures]]]) -> Table:
    """One row for each model and graph; the published rows below."""
    rows: list[tuple[Cell, ...]] = []
    for trained, nodes, figures in found:
        for kind, each in figures.items():
            name = f"{trained.folder}, {kind}"
            rows.append((name, nodes, each.components, each.mean, each.greatest))
    notes = (
        "Graphs of latent points of training strings (strings §5.3): connected components, mean and greatest "
        "accumulated weight of the shortest paths. Naive: the 3 nearest strings by edit distance of their tokens; "
        "search graph: the 4 nearest points; both: all strings of the same shape graph.",
    )
    columns = ("graph", "nodes", "components", "mean", "greatest")
    return Table("String VAE: shortest paths", columns, tuple(rows), notes, PUBLISHED)


def model_rng(seed: int, trained: TrainedModel[TrainedStringVae], decision: str) -> np.random.Generator:
    """The random stream of one decision about a model."""
    return decision_rng(seed, "eval", "strings", trained.group, trained.seed, decision)


def _codes(model: TrainedStringVae, string: str) -> list[int]:
    codes: list[int] = model.vocabulary.codes(string).tolist()
    return codes


def _graph(model: TrainedStringVae, string: str) -> str:
    decoded = decode(string, model.vocabulary.alphabet)
    return graph_digest(decoded.types, decoded.edges)
