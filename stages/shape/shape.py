"""A shape: the geometry of one sample, whatever made it, as points, sketches, package and eval read it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import TypeArray
from stages.shape.kit import Assembly, PartMesh

__all__ = ["Shape"]


@dataclass(frozen=True)
class Shape:
    """Parts with meshes, poses and labels.

    meshes: what `assembly.types` counts into; of a kit all its types, of a program the meshes of this one shape.
    assembly: which mesh stands where, and which parts touch; its edges are empty where nobody has asked yet.
    up: the axis that points up, `"y"` or `"z"`; labels: the vocabulary of part labels, the same for every shape of
    one kit or program, in a fixed order. The name of each mesh is one of them.
    """

    meshes: tuple[PartMesh, ...]
    assembly: Assembly
    up: Literal["y", "z"]
    labels: tuple[str, ...]

    @cached_property
    def label_of(self) -> TypeArray:
        """For each mesh the index of its name in `labels`, int16 (k,)."""
        places = {name: index for index, name in enumerate(self.labels)}
        return np.array([places[mesh.name] for mesh in self.meshes], dtype=np.int16)

    def __len__(self) -> int:
        return len(self.assembly)
