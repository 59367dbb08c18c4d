"""Exemplars with longer and shorter rows as variants of a search: assemblies of the kit's own parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.rows.changes import Change
from stages.rows.draws import LayoutDraws
from stages.rows.layout import LengthenedMesh, graph_layout
from stages.rows.settings import RowsConfig
from stages.shape.kit import Assembly, Kit
from stages.variations.search.variant import DUPLICATE

NO_CHANGE = "rows: no change fits"
LENGTHENED = "rows: a part would become longer or shorter"


@dataclass(frozen=True)
class ChangedRows:
    """An exemplar with longer or shorter rows.

    exemplar: its number in the kit
    changes: changes of its rows, one after another
    assembly: the result
    origins: the part of the exemplar that each part is or was copied from, int64 (n,)
    """

    exemplar: int
    changes: tuple[Change, ...]
    assembly: Assembly
    origins: np.ndarray


class RowVariants:
    """Draws exemplars of one kit with longer and shorter rows. What it remembers saves time and changes no result."""

    def __init__(self, kit: Kit, config: RowsConfig) -> None:
        self._kit, self._config = kit, config
        self._known: set[tuple[int, bytes]] = set()

    @cached_property
    def _draws(self) -> list[tuple[int, LayoutDraws]]:
        """The exemplars that have rows, each with its number."""
        drawn = [LayoutDraws(graph_layout(self._kit, exemplar), self._config) for exemplar in self._kit.exemplars]
        return [(number, draws) for number, draws in enumerate(drawn) if draws.rows or draws.circles]

    def __bool__(self) -> bool:
        """Whether an exemplar has rows."""
        return bool(self._draws)

    def draw(self, rng: np.random.Generator) -> ChangedRows | str:
        """Return an exemplar with other rows that was not drawn yet, or why none was made.

        Raises IndexError for a kit without rows.
        """
        number, draws = self._draws[int(rng.integers(len(self._draws)))]
        drawn = draws.draw(rng)
        if drawn is None:
            return NO_CHANGE
        changes, layout = drawn
        if (number, layout.key) in self._known:
            return DUPLICATE
        self._known.add((number, layout.key))
        if any(isinstance(mesh, LengthenedMesh) for mesh in layout.meshes):
            return LENGTHENED
        return ChangedRows(number, changes, layout.assembly(), layout.origins)
