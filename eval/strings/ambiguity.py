"""Ambiguity of shape graphs: how many different shapes have one graph (strings §6)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from eval.engine.table import Table
from stages.shape.arrays import IntArray
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.strings.categories import CategorizedString, CategorySpace, NoCategoryError
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded, NotConnectedError
from stages.strings.kit_strings import KitStrings

NOTES = (
    "The graph of each shape is instantiated several times at random, and each valid result is labelled along the "
    "shape's canonical string. Shapes: mean number of different results of a graph. Tokens, open: percentage with the "
    "category of the original shape, as in the first table. No model can do better without knowing which of the valid "
    "shapes of a graph is meant.",
)


@dataclass(frozen=True)
class Ambiguity:
    """How ambiguous the graphs of a kit are."""

    graphs: int
    """Those with a valid instantiation."""
    draws: int
    """Instantiations of each graph."""
    shapes: float
    """Mean number of different shapes of a graph."""
    tokens: float
    """Percentage of tokens with the category of the original shape."""
    open: float
    """The same, of tokens with several possible categories."""


def ambiguity(
    instantiator: Instantiator, writer: KitStrings, shapes: Iterable[Assembly], draws: int, rng: np.random.Generator
) -> Ambiguity:
    """Measure some shapes of a kit; those without a string or categories are left out."""
    space = CategorySpace(instantiator.kit)
    method = STANDARD_METHOD._replace(whole=writer.edges == "all")
    right, open_right, counts = [0, 0], [0, 0], list[int]()
    for shape in shapes:
        graph = writer.graph(shape)
        try:
            (string,) = writer.strings(graph, 0, rng)
            (truth,) = space.label(shape, [string], either_hand=True)
        except (NotConnectedError, NoCategoryError):
            continue
        decoded = decode(string.string, writer.alphabet)
        categories: list[IntArray] = []
        for _ in range(draws):
            instance = instantiator.instantiate(decoded.types, decoded.edges, rng, method).assembly
            if instance is not None:
                categories += [labelled.categories for labelled in _label(space, instance, string)]
        if not categories:
            continue
        counts.append(len({row.tobytes() for row in categories}))
        is_open = space.allowed(truth.string).sum(axis=1) > 1
        same = np.array(categories) == truth.categories
        right = [right[0] + int(same.sum()), right[1] + same.size]
        open_right = [open_right[0] + int(same[:, is_open].sum()), open_right[1] + same[:, is_open].size]
    shares = (100 * part / max(whole, 1) for part, whole in (right, open_right))
    return Ambiguity(len(counts), draws, float(np.mean(counts)) if counts else 0.0, *shares)


def _label(space: CategorySpace, instance: Assembly, string: Encoded) -> list[CategorizedString]:
    """Label a shape whose parts are in the order of a string; nothing if a pair of parts has no category."""
    try:
        return space.label(instance, [Encoded(string.string, np.arange(len(instance)))], either_hand=True)
    except NoCategoryError:
        return []


def ambiguity_table(kits: Sequence[tuple[str, Ambiguity]]) -> Table:
    """Return one row for each kit."""
    columns = ("kit", "graphs", "draws", "shapes", "tokens %", "open %")
    rows = [(kit, *astuple(measured)) for kit, measured in kits]
    return Table("Ambiguity of shape graphs", columns, tuple(rows), NOTES)
