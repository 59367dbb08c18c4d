"""How much a graph leaves open of its shape: what no model of edge categories can read from it (strings §6)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

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
    "The graph of each shape, from its canonical string, is put together anew several times by chance, and each valid "
    "shape that comes out is read along the same string. Shapes: different ones of a graph, in the mean. Tokens, open: "
    "those that have the category of the shape which the string was written of, as in the first table: what can be had "
    "without having learnt which of the valid shapes of a graph is meant.",
)


@dataclass(frozen=True)
class Ambiguity:
    """graphs: those of which a valid shape was found; draws: how often each was put together; shapes: different ones
    of a graph, in the mean; tokens, open: those with the category of the shape it was written of, in percent, as in
    `Shares`."""

    graphs: int
    draws: int
    shapes: float
    tokens: float
    open: float


def ambiguity(
    maker: Instantiator, writer: KitStrings, shapes: Iterable[Assembly], draws: int, rng: np.random.Generator
) -> Ambiguity:
    """Of some shapes of a kit; those without a string or categories are left out."""
    space = CategorySpace(maker.kit)
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
        found: list[IntArray] = []
        for _ in range(draws):
            made = maker.instantiate(decoded.types, decoded.edges, rng, method).assembly
            if made is not None:
                found += [each.categories for each in _read(space, made, string)]
        if not found:
            continue
        counts.append(len({each.tobytes() for each in found}))
        is_open = space.allowed(truth.string).sum(axis=1) > 1
        same = np.array(found) == truth.categories
        right = [right[0] + int(same.sum()), right[1] + same.size]
        open_right = [open_right[0] + int(same[:, is_open].sum()), open_right[1] + same[:, is_open].size]
    shares = (100 * part / max(whole, 1) for part, whole in (right, open_right))
    return Ambiguity(len(counts), draws, float(np.mean(counts)) if counts else 0.0, *shares)


def _read(space: CategorySpace, made: Assembly, string: Encoded) -> list[CategorizedString]:
    """A shape whose parts stand in the order of a string, along that string; nothing where parts stand as no shape of
    the kit has them."""
    try:
        return space.label(made, [Encoded(string.string, np.arange(len(made)))], either_hand=True)
    except NoCategoryError:
        return []


def ambiguity_table(found: Sequence[tuple[str, Ambiguity]]) -> Table:
    """One row for each kit."""
    columns = ("kit", "graphs", "draws", "shapes", "tokens %", "open %")
    rows = [(kit, each.graphs, each.draws, each.shapes, each.tokens, each.open) for kit, each in found]
    return Table("What graphs leave open of their shapes", columns, tuple(rows), NOTES)
