"""The text of a sample, as JSON: the exemplar, the changes of its rows, and the factors of its intervals."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.proportions.warp import Lattice, Warp, lattice_of, warped
from stages.rows.changes import Change, change_json, changed, read_change
from stages.rows.layout import Layout, layout_of
from stages.rows.slabs import SlabError
from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.shape.shape import Shape, kit_shape

AXES = ("x", "y", "z")
ROWS_KEY = "rows"
MAX_CHANGES = 1000


class ProportionError(ValueError):
    """A text without valid proportions of an exemplar of its kit."""


@dataclass(frozen=True)
class Proportions:
    """What a text says.

    exemplar: name of the exemplar
    warp: factors of the intervals along each axis, after the changes
    changes: changes of its rows, one after another
    """

    exemplar: str
    warp: Warp
    changes: tuple[Change, ...] = ()


def proportion_text(proportions: Proportions) -> str:
    """Return the text of proportions."""
    rows = [change_json(change) for change in proportions.changes]
    factors = {axis: values.tolist() for axis, values in zip(AXES, proportions.warp, strict=True)}
    changed = {ROWS_KEY: rows} if rows else {}
    return json.dumps({"exemplar": proportions.exemplar, **changed, **factors}, ensure_ascii=False)


def read_proportions(text: str) -> Proportions:
    """Return what a text says. Raises ProportionError."""
    try:
        fields = json.loads(text)
        if set(fields) - {ROWS_KEY} != {"exemplar", *AXES} or not isinstance(fields["exemplar"], str):
            raise ProportionError(f"proportions have the keys exemplar, x, y and z, and may have rows: {text[:80]}")
        x, y, z = (np.array(fields[axis], dtype=np.float64).reshape(-1) for axis in AXES)
        changes = tuple(read_change(row) for row in fields.get(ROWS_KEY, ())[:MAX_CHANGES])
    except (ValueError, TypeError, KeyError) as error:
        if isinstance(error, ProportionError):
            raise
        raise ProportionError(f"not valid proportions: {error}") from None
    return Proportions(fields["exemplar"], (x, y, z), changes)


def exemplar_of(kit: Kit, name: str) -> Exemplar:
    """Return the exemplar of a kit with a name. Raises ProportionError."""
    for exemplar in kit.exemplars:
        if exemplar.name == name:
            return exemplar
    raise ProportionError(f"kit {kit.name} has no exemplar {name!r}; it has {', '.join(e.name for e in kit.exemplars)}")


@dataclass(frozen=True)
class Unwarped:
    """An exemplar with other rows, before its lengths are multiplied.

    assembly: its parts by types of the kit, with the contacts that they keep
    layout: the same with the surfaces of the parts; None for an exemplar whose rows are not changed
    """

    assembly: Assembly
    shape: Shape
    lattice: Lattice
    layout: Layout | None


class ProportionShapes:
    """The shapes of texts of one kit. What it remembers saves time and never changes a shape."""

    def __init__(self, kit: Kit) -> None:
        self.kit = kit
        self._layouts: dict[str, Layout] = {}
        self._exemplars: dict[str, Unwarped] = {}

    def layout(self, name: str) -> Layout:
        """Return the layout of the exemplar with a name."""
        if name not in self._layouts:
            self._layouts[name] = layout_of(self.kit, exemplar_of(self.kit, name))
        return self._layouts[name]

    def unwarped(self, exemplar: str, changes: Sequence[Change]) -> Unwarped:
        """Return an exemplar with other rows. Raises ProportionError for changes that are not valid."""
        if not changes:
            if exemplar not in self._exemplars:
                whole = exemplar_of(self.kit, exemplar).whole
                shape = kit_shape(self.kit, whole)
                self._exemplars[exemplar] = Unwarped(whole, shape, self._lattice(shape), None)
            return self._exemplars[exemplar]
        layout = self.layout(exemplar)
        for change in changes:
            try:
                layout = changed(layout, change)
            except SlabError as error:
                raise ProportionError(f"{exemplar}: {json.dumps(change_json(change))} is not valid: {error}") from None
        return self.unwarped_layout(layout)

    def unwarped_layout(self, layout: Layout) -> Unwarped:
        """Return a layout whose rows are changed."""
        shape = layout.shape(self.kit)
        return Unwarped(layout.assembly(), shape, self._lattice(shape), layout)

    def _lattice(self, shape: Shape) -> Lattice:
        return lattice_of(shape, self.kit.contact_tolerance)

    def warped(self, unwarped: Unwarped, warp: Sequence[FloatArray]) -> Shape:
        """Return a shape with its lengths multiplied. Raises ProportionError for factors that do not fit."""
        try:
            return warped(unwarped.shape, unwarped.lattice, warp)
        except ValueError as error:
            raise ProportionError(str(error)) from None


def shape_of_proportion_text(shapes: ProportionShapes, text: str) -> Shape:
    """Return the shape of a text, with the contacts of the exemplar or of its layout. Raises ProportionError."""
    proportions = read_proportions(text)
    unwarped = shapes.unwarped(proportions.exemplar, proportions.changes)
    shape = shapes.warped(unwarped, proportions.warp)
    return replace(shape, assembly=replace(shape.assembly, edges=unwarped.assembly.edges))
