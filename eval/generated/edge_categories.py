"""How well models of edge categories read from a string where its parts stand (strings §6)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.models import TrainedModel, by_group, over_seeds, trained_models
from eval.engine.table import Cell, ReferenceRow, Table
from eval.generated.pose_clusters import Clusters
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
    "Of shapes whose graphs training has not seen: the canonical string of each and as many random ones as vote. "
    "Tokens: those that have the category of the shape, of all, as published; open: of those that may have more than "
    "one category; whole: strings of which all are right. Each token is told by what was told before it, right or "
    "wrong; given: tokens that are right where all before them are. A graph does not say how a flag is turned: a shape "
    "may be another than the one that the string was written of, and as good. Closes: strings whose parts, put where "
    "they are said to stand, all dock as their edges say.",
    "Voted: each string of a graph proposes a shape; those that close are judged by all strings, and the likeliest is "
    "taken; where none closes each string keeps its own opinion.",
)


@dataclass(frozen=True)
class Shares:
    """Of some strings, in percent: tokens that are right, of all and of those with several categories to choose from;
    strings that are right throughout; strings whose edges all dock."""

    tokens: float
    open: float
    whole: float
    closes: float


@dataclass(frozen=True)
class Judged:
    """given: tokens that are right where those before them are, in percent; alone: each string by itself; voted: all
    strings of a graph together."""

    graphs: int
    strings: int
    given: float
    alone: Shares
    voted: Shares


def category_models(folder: Path, kits: dict[str, Kit]) -> list[TrainedModel[TrainedEdgeCategories]]:
    """The models of edge categories of some kits in a folder of published models. Raises ConfigError for weights that
    are not what they should be."""
    return trained_models(
        folder, "edge_categories", lambda path, header: load_edge_categories(path, kits[header["kit"]]), kits
    )


def made_shapes(subject: DatasetRun, kit: str, split: str) -> Iterator[Assembly]:
    """The shapes of a kit in a split, out of the mill's folder, one in memory at a time; none with stretched parts.
    Raises ConfigError where the config lets go of them."""
    if subject.config.keep == "dataset":
        raise ConfigError("the shapes were let go of; keep: all in the config, and make dataset")
    for producer in producers():
        folder = subject.paths.stage(producer).root
        for shard in sorted(folder.glob(f"{subject.config.name}-{split}-*.tar")):
            found = (sample.assembly for sample in read_samples(shard) if sample.kit == kit)
            yield from (each for each in found if each.stretches is None)


def judge(
    model: TrainedEdgeCategories, writer: KitStrings, shapes: Iterable[Assembly], voters: int, rng: np.random.Generator
) -> Judged:
    """What a model says of some shapes, by strings of them; shapes without strings or categories are left out. `voters`
    strings of each shape beside its canonical one."""
    alone, voted = _Tally(), _Tally()
    asked: list[list[Encoded]] = []
    labelled: list[list[CategorizedString]] = []
    for shape in shapes:
        try:
            strings = writer.strings(writer.graph(shape), voters, rng)
            labelled.append(model.space.label(shape, strings, either_hand=True))
            asked.append(strings)
        except (NotConnectedError, NoCategoryError):
            continue
    # All at once: a walker goes token by token, whatever the number of strings.
    texts = [each.string for strings in asked for each in strings]
    truth = [each.categories for of_shape in labelled for each in of_shape]
    given = [0, 0]
    for scores, wanted in zip(model.log_probabilities(texts, truth), truth, strict=True):
        given = [given[0] + int((scores.argmax(axis=1) == wanted).sum()), given[1] + len(wanted)]
    said = iter(model.choose(texts, None))
    for strings, of_shape in zip(asked, labelled, strict=True):
        own = list(islice(said, len(strings)))
        ballots = model.vote(strings, own)
        together = ballots[0].categories if ballots else own
        for each, one, all_said in zip(of_shape, own, together, strict=True):
            alone.add(model, each, one)
            voted.add(model, each, all_said)
    return Judged(len(asked), alone.strings, 100 * given[0] / max(given[1], 1), alone.shares(), voted.shares())


def read_back(
    model: TrainedEdgeCategories, writer: KitStrings, shape: Assembly, voters: int, rng: np.random.Generator
) -> Assembly | None:
    """What strings of a shape vote for, if anything that they propose closes, with its first part where it stands in
    the shape, turned as brings the others nearest to theirs. Raises NotConnectedError for a shape without strings."""
    strings = writer.strings(writer.graph(shape), voters, rng)
    ballots = model.vote(strings)
    if not ballots:
        return None
    placed = model.space.place(strings[0].string, ballots[0].categories[0])
    wanted = shape.poses[strings[0].nodes]
    ways = wanted[0] @ model.space.kit.types[placed.types[0]].symmetries[:, None] @ placed.poses
    gaps = np.linalg.norm(ways[..., :3, 3] - wanted[:, :3, 3], axis=-1).sum(axis=1)
    return replace(placed, poses=ways[gaps.argmin()])


class _Tally:
    """Counts of what is right."""

    def __init__(self) -> None:
        self.strings = self.whole = self.closing = 0
        self._tokens, self._open = [0, 0], [0, 0]

    def add(self, model: TrainedEdgeCategories, labelled: CategorizedString, said: IntArray) -> None:
        right = said == labelled.categories
        is_open = model.space.allowed(labelled.string).sum(axis=1) > 1
        self.strings += 1
        self.whole += bool(right.all())
        self.closing += _closes(model, labelled.string, said)
        self._tokens = [self._tokens[0] + int(right.sum()), self._tokens[1] + len(right)]
        self._open = [self._open[0] + int(right[is_open].sum()), self._open[1] + int(is_open.sum())]

    def shares(self) -> Shares:
        parts = (self._tokens, self._open, (self.whole, self.strings), (self.closing, self.strings))
        return Shares(*(100 * part / max(whole, 1) for part, whole in parts))


def _closes(model: TrainedEdgeCategories, string: str, said: IntArray) -> bool:
    """Whether all edges of a string dock where its parts are said to stand."""
    try:
        placed = model.space.place(string, said)
        model.space.label(placed, [Encoded(string, np.arange(len(placed)))])
    except ValueError:  # which NoCategoryError is
        return False
    return True


def categories_table(found: Sequence[tuple[TrainedModel[TrainedEdgeCategories], str, Judged]]) -> Table:
    """One row for the models of a name and a kit and a split, over their seeds, alone and voted."""
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
    for split in dict.fromkeys(split for _, split, _ in found):
        for group, each in by_group((model, one) for model, of, one in found if of == split).items():
            head = (group, split, len(each), each[0].graphs, each[0].strings)
            given = over_seeds(each, ("given",))
            rows.append((*head, "alone", *given, *over_seeds([one.alone for one in each], names)))
            rows.append((*head, "voted", "", *over_seeds([one.voted for one in each], names)))
    return Table("Edge categories read from strings", columns, tuple(sorted(rows, key=_order)), NOTES, PUBLISHED)


def _order(row: tuple[Cell, ...]) -> tuple[str, str]:
    return str(row[0]), str(row[1])


def clusters_table(found: Iterable[tuple[str, int, Clusters]]) -> Table:
    """One row for each kit: how many shapes, and their clusters."""
    columns = ("kit", "shapes", "edges", "known", "used", "clusters", "one to one", "spread")
    rows = [
        (kit, shapes, each.edges, each.known, each.used, each.found, each.pure, each.spread)
        for kit, shapes, each in found
    ]
    notes = (
        "Clusters of the relative poses of parts in contact by mean shift, as in the paper, over the training shapes: "
        "each edge is seen from both its ends, modulo the symmetries of the part that is seen. Known: categories of "
        "edges that follow from the kit's dockings; used: those that edges of the shapes have; one to one: clusters "
        "that are one category, and that category no other cluster. Spread: the greatest distance of a pose from the "
        "mean of its cluster, in tolerances.",
    )
    return Table("Edge categories and clusters", columns, tuple(rows), notes)
