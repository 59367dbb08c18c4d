"""The text of a sample: which exemplar, and the factors of its intervals along each axis, as JSON."""

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
    """A text that says no proportions of an exemplar of its kit."""


def proportion_text(exemplar: str, warp: Sequence[FloatArray]) -> str:
    """The text of an exemplar's shape with these factors."""
    factors = {axis: values.tolist() for axis, values in zip(AXES, warp, strict=True)}
    return json.dumps({"exemplar": exemplar, **factors}, ensure_ascii=False)


def read_proportions(text: str) -> tuple[str, Warp]:
    """The exemplar's name and the factors. Raises ProportionError."""
    try:
        said = json.loads(text)
        if set(said) != {"exemplar", *AXES} or not isinstance(said["exemplar"], str):
            raise ProportionError(f"proportions have the keys exemplar, x, y and z: {text[:80]}")
        x, y, z = (np.array(said[axis], dtype=np.float64).reshape(-1) for axis in AXES)
    except (ValueError, TypeError) as error:
        if isinstance(error, ProportionError):
            raise
        raise ProportionError(f"no proportions: {error}") from None
    return said["exemplar"], (x, y, z)


def exemplar_of(kit: Kit, name: str) -> Exemplar:
    """The exemplar of a kit with a name. Raises ProportionError."""
    for exemplar in kit.exemplars:
        if exemplar.name == name:
            return exemplar
    raise ProportionError(f"kit {kit.name} has no exemplar {name!r}; it has {', '.join(e.name for e in kit.exemplars)}")


def shape_of_text(kit: Kit, text: str) -> Shape:
    """The shape that a text says. Raises ProportionError."""
    name, warp = read_proportions(text)
    exemplar = exemplar_of(kit, name).whole
    try:
        return warped(kit, exemplar, lattice_of(kit, exemplar), warp)
    except ValueError as error:
        raise ProportionError(f"{name}: {error}") from None
