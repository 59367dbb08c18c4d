"""A finished sample as `make verify` reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.shape import Shape


@dataclass(frozen=True)
class PackagedSample:
    """One sample of a finished dataset.

    record: its `json`
    members: its files by what follows the key
    arrays: the `.npy` files among them
    shape: shape rebuilt from the record's source, in the coordinates of the dataset
    sections: config sections from the manifest
    """

    key: str
    record: Mapping[str, Any]
    members: Mapping[str, bytes]
    arrays: Mapping[str, np.ndarray]
    shape: Shape
    sections: Mapping[str, Any]

    @cached_property
    def contacts(self) -> IntArray:
        """The pairs of parts that touch, int32 (m, 2), as recorded."""
        return pairs_of(self.members[CONTACTS])

    @cached_property
    def size(self) -> float:
        """The longest side of the bounding box of the shape, in its units."""
        bounds = shape_bounds(self.shape)
        return float((bounds[1] - bounds[0]).max())

    @cached_property
    def rays(self) -> RayCaster:
        """The ray caster of the shape."""
        return RayCaster(self.shape)
