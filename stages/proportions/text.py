"""The text of a sample: the exemplar, and the factors of its intervals along each axis, as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from stages.proportions.warp import Warp, lattice_of, warped
from stages.shape.arrays import FloatArray
from stages.shape.kit import Exemplar, Kit
from stages.shape.shape import Shape

AXES = ("x", "y", "z")


class ProportionError(ValueError):
    """A text without valid proportions of an exemplar of its kit."""


def proportion_text(exemplar: str, warp: Sequence[FloatArray]) -> str:
    """Return the text of an exemplar's shape with these factors."""
    factors = {axis: values.tolist() for axis, values in zip(AXES, warp, strict=True)}
    return json.dumps({"exemplar": exemplar, **factors}, ensure_ascii=False)


def read_proportions(text: str) -> tuple[str, Warp]:
    """Return the exemplar's name and the factors. Raises ProportionError."""
    try:
        fields = json.loads(text)
        if set(fields) != {"exemplar", *AXES} or not isinstance(fields["exemplar"], str):
            raise ProportionError(f"proportions have the keys exemplar, x, y and z: {text[:80]}")
        x, y, z = (np.array(fields[axis], dtype=np.float64).reshape(-1) for axis in AXES)
    except (ValueError, TypeError) as error:
        if isinstance(error, ProportionError):
            raise
        raise ProportionError(f"not valid proportions: {error}") from None
    return fields["exemplar"], (x, y, z)


def exemplar_of(kit: Kit, name: str) -> Exemplar:
    """Return the exemplar of a kit with a name. Raises ProportionError."""
    for exemplar in kit.exemplars:
        if exemplar.name == name:
            return exemplar
    raise ProportionError(f"kit {kit.name} has no exemplar {name!r}; it has {', '.join(e.name for e in kit.exemplars)}")


def shape_of_text(kit: Kit, text: str) -> Shape:
    """Return the shape of a text. Raises ProportionError."""
    name, warp = read_proportions(text)
    exemplar = exemplar_of(kit, name).whole
    try:
        return warped(kit, exemplar, lattice_of(kit, exemplar), warp)
    except ValueError as error:
        raise ProportionError(f"{name}: {error}") from None
