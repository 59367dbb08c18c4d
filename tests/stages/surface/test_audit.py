"""The checks of `make verify` find what is wrong with surfaces, distances and occupancy."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.paths import DatasetPaths
from pipeline.shards import bytes_array
from stages.shape.collection.packaged import PackagedSample
from stages.surface.audit import AUDIT
from stages.surface.stage import surface_members
from tests.stages.surface.solids import shape_of
from tests.stages.surface.test_distances import ALL, CROSS

SHAPE = shape_of(*CROSS)
MEMBERS = surface_members(SHAPE, ALL, np.random.default_rng(1))


def faults(change: Callable[[dict[str, Any], dict[str, np.ndarray]], None]) -> list[str]:
    record = {"parts": [{}, {}], **json.loads(MEMBERS["json"])}
    arrays = {name: bytes_array(content).copy() for name, content in MEMBERS.items() if name.endswith(".npy")}
    change(record, arrays)
    sample = PackagedSample("a-1", record, MEMBERS, arrays, SHAPE, {})
    return [*AUDIT.faults(sample), *AUDIT.recheck(sample, DatasetPaths(Path(), "a"))]


def test_a_sample_as_it_is_made_has_no_faults() -> None:
    assert faults(lambda record, arrays: None) == []


def half(array: np.ndarray) -> None:
    array[: len(array) // 2] *= -1


def without_a_face(_: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    for name in ("union_faces.npy", "union_instances.npy"):
        arrays[name] = arrays[name][1:]


CHANGES: dict[str, tuple[Callable[[dict[str, Any], dict[str, np.ndarray]], None], str]] = {
    "closed": (lambda record, _: record["surface"].update(closed=False), "its parts do not"),
    "part flag": (lambda record, _: record["surface"]["parts"][1].update(closed=False), "its parts do not"),
    "volume": (lambda record, _: record["union"].update(volume=6.0), "its json says 6.0"),
    "hole": (without_a_face, "watertight"),
    "part of a face": (lambda _, arrays: arrays["union_instances.npy"].__setitem__(0, 9), "parts that do not exist"),
    "signs": (lambda _, arrays: half(arrays["sdf_values.npy"]), "signed distance"),
    "lengths": (lambda _, arrays: arrays["sdf_values.npy"].__imul__(1.01), "signed distance outside"),
    "points": (lambda _, arrays: arrays["sdf_points.npy"].__iadd__(0.1), "signed distance"),
    "occupancy": (lambda _, arrays: arrays["occupancy.npy"].fill(255), "occupancy fills"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_found(name: str) -> None:
    change, sentence = CHANGES[name]
    assert any(sentence in fault for fault in faults(change))
