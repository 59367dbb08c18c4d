"""Accuracy of models that predict edge categories, and thereby poses, from strings (strings §6)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.models import TrainedModel, by_group, over_seeds, trained_models
from eval.engine.table import Cell, ReferenceRow, Table
from eval.generated.pose_clusters import PoseClusters
from pipeline.errors import ConfigError
from stages.shape.arrays import IntArray
from stages.shape.collection.discovery import producers
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import read_samples
from stages.strings.categories import CategorizedString, NoCategoryError
from stages.strings.encoder import Encoded, NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.training.edge_categories.trained import TrainedEdgeCategories, load_edge_categories

PUBLISHED = (ReferenceRow("validation samples", "strings, §6", {"tokens %": 90.0}),)

NOTES = (
    "Of shapes whose graphs training has not seen: the canonical string of each, and the random strings that vote. "
    "Tokens: with the category of the shape, of all tokens, as published. Open: of the tokens with several possible "
    "categories. Whole: strings with all tokens right. Each token is predicted after the predicted ones before it; "
    "given: after the true ones. A graph does not determine how a flag is turned, so a prediction may be another valid "
    "shape of the graph. Closes: strings whose parts, at the predicted poses, all dock as their edges require.",
    "Voted: each string of a graph proposes a shape; all strings rate the proposals that close, and the likeliest is "
    "taken. If none closes, each string keeps its own prediction.",
)


@dataclass(frozen=True)
class CategoryShares:
    """Percentages over some strings."""

    tokens: float
    """Right tokens, of all."""
    open: float
    """Right tokens, of those with several possible categories."""
    whole: float
    """Strings with all tokens right."""
    closes: float
    """Strings whose edges all dock."""


@dataclass(frozen=True)
class CategoryScores:
    """The accuracy of one model."""

    graphs: int
    strings: int
    given: float
    """Percentage of right tokens after the true ones."""
    alone: CategoryShares
    """Of each string by itself."""
    voted: CategoryShares
    """Of the vote of all strings of a graph."""


def category_models(folder: Path, kits: dict[str, Kit]) -> list[TrainedModel[TrainedEdgeCategories]]:
    """Load the models of edge categories of some kits in a folder of published models.

    Raises ConfigError for weights that cannot be read.
    """
    return trained_models(
        folder, "edge_categories", lambda path, header: load_edge_categories(path, kits[header["kit"]]), kits
    )


def split_assemblies(run: DatasetRun, kit: str, split: str) -> Iterator[Assembly]:
    """Yield the shapes of a kit in a split from the pipeline's folder, without those with stretched parts.

    Raises ConfigError if the config prunes them.
    """
    if run.config.keep == "dataset":
        raise ConfigError("the shapes were pruned; set keep: all in the config, and make dataset")
    joined = [name for name, declared in producers().items() if declared.joins and declared.is_requested(run.config)]
    for producer in joined or producers():
        folder = run.paths.stage(producer).root
        for shard in sorted(folder.glob(f"{run.config.name}-{split}-*.tar")):
            assemblies = (sample.assembly for sample in read_samples(shard) if sample.kit == kit)
            yield from (assembly for assembly in assemblies if len(assembly) and assembly.stretches is None)


def score_model(
    model: TrainedEdgeCategories, writer: KitStrings, shapes: Iterable[Assembly], voters: int, rng: np.random.Generator
) -> CategoryScores:
    """Score a model on some shapes; those without strings or categories are left out.

    voters: random strings of each shape, besides its canonical one.
    """
    alone, voted = _Counter(), _Counter()
    encoded: list[list[Encoded]] = []
    labelled: list[list[CategorizedString]] = []
    for shape in shapes:
        try:
            strings = writer.strings(writer.graph(shape), voters, rng)
            labelled.append(model.space.label(shape, strings, either_hand=True))
            encoded.append(strings)
        except (NotConnectedError, NoCategoryError):
            continue
    # All in one batch: an autoregressive decoder takes as long for many strings as for one.
    texts = [string.string for strings in encoded for string in strings]
    truth = [string.categories for of_shape in labelled for string in of_shape]
    given = [0, 0]
    for scores, target in zip(model.log_probabilities(texts, truth), truth, strict=True):
        given = [given[0] + int((scores.argmax(axis=1) == target).sum()), given[1] + len(target)]
    predictions = iter(model.choose(texts, None))
    for strings, of_shape in zip(encoded, labelled, strict=True):
        own = list(islice(predictions, len(strings)))
        results = model.vote(strings, own)
        together = results[0].categories if results else own
        for string, own_categories, voted_categories in zip(of_shape, own, together, strict=True):
            alone.add(model, string, own_categories)
            voted.add(model, string, voted_categories)
    return CategoryScores(
        len(encoded), alone.strings, 100 * given[0] / max(given[1], 1), alone.shares(), voted.shares()
    )


def reconstruct_shape(
    model: TrainedEdgeCategories, writer: KitStrings, shape: Assembly, voters: int, rng: np.random.Generator
) -> Assembly | None:
    """Return the shape that strings of a shape vote for, or None if no proposal closes.

    Its first part is at the pose of the original, turned by the symmetry that brings the other parts nearest to
    theirs. Raises NotConnectedError for a shape without strings.
    """
    strings = writer.strings(writer.graph(shape), voters, rng)
    results = model.vote(strings)
    if not results:
        return None
    placed = model.space.place(strings[0].string, results[0].categories[0])
    original = shape.poses[strings[0].nodes]
    images = original[0] @ model.space.kit.types[placed.types[0]].symmetries[:, None] @ placed.poses
    gaps = np.linalg.norm(images[..., :3, 3] - original[:, :3, 3], axis=-1).sum(axis=1)
    return replace(placed, poses=images[gaps.argmin()])


class _Counter:
    """Counts right predictions."""

    def __init__(self) -> None:
        self.strings = self.whole = self.closing = 0
        self._tokens, self._open = [0, 0], [0, 0]

    def add(self, model: TrainedEdgeCategories, labelled: CategorizedString, categories: IntArray) -> None:
        right = categories == labelled.categories
        is_open = model.space.allowed(labelled.string).sum(axis=1) > 1
        self.strings += 1
        self.whole += bool(right.all())
        self.closing += _closes(model, labelled.string, categories)
        self._tokens = [self._tokens[0] + int(right.sum()), self._tokens[1] + len(right)]
        self._open = [self._open[0] + int(right[is_open].sum()), self._open[1] + int(is_open.sum())]

    def shares(self) -> CategoryShares:
        parts = (self._tokens, self._open, (self.whole, self.strings), (self.closing, self.strings))
        return CategoryShares(*(100 * part / max(whole, 1) for part, whole in parts))


def _closes(model: TrainedEdgeCategories, string: str, categories: IntArray) -> bool:
    """Return whether all edges of a string dock if its parts are placed by the categories."""
    try:
        placed = model.space.place(string, categories)
        model.space.label(placed, [Encoded(string, np.arange(len(placed)))])
    except ValueError:  # NoCategoryError is one
        return False
    return True


def categories_table(results: Sequence[tuple[TrainedModel[TrainedEdgeCategories], str, CategoryScores]]) -> Table:
    """Return two rows, alone and voted, for the models of a name, a kit and a split, over their seeds."""
    columns = (
        "model",
        "split",
        "seeds",
        "graphs",
        "strings",
        "",
        "given %",
        "tokens %",
        "open %",
        "whole %",
        "closes %",
    )
    rows: list[tuple[Cell, ...]] = []
    names = ("tokens", "open", "whole", "closes")
    for split in dict.fromkeys(split for _, split, _ in results):
        of_split = ((model, scores) for model, other, scores in results if other == split)
        for group, seeds in by_group(of_split).items():
            head = (group, split, len(seeds), seeds[0].graphs, seeds[0].strings)
            given = over_seeds(seeds, ("given",))
            rows.append((*head, "alone", *given, *over_seeds([scores.alone for scores in seeds], names)))
            rows.append((*head, "voted", "", *over_seeds([scores.voted for scores in seeds], names)))
    rows.sort(key=lambda row: (str(row[0]), str(row[1])))
    return Table("Edge categories predicted from strings", columns, tuple(rows), NOTES, PUBLISHED)


def clusters_table(kits: Iterable[tuple[str, int, PoseClusters]]) -> Table:
    """Return one row for each kit: its number of shapes, and their clusters."""
    columns = ("kit", "shapes", "edges", "known", "used", "clusters", "one to one", "max distance")
    rows = [(kit, shapes, *astuple(clusters)) for kit, shapes, clusters in kits]
    notes = (
        "Clusters of the relative poses of parts in contact by mean shift, as in the paper, over the training shapes. "
        "Each edge counts from both ends, modulo the symmetries of the other part. Known: edge categories that follow "
        "from the kit's dockings. Used: categories of the edges. One to one: clusters that are one category, which no "
        "other cluster has. Max distance: of a pose from the mean of its cluster, in tolerances.",
    )
    return Table("Edge categories and clusters", columns, tuple(rows), notes)
