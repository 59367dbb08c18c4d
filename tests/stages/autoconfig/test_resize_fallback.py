"""Bays of modules replace layouts of a search that look alike, and no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from stages.autoconfig.resize_fallback import ALIKE, MAX_ALIKE_DISTANCE, ResizeFallback, resize_fallback
from stages.autoconfig.resolve import Resolution
from stages.autoconfig.resolved_kit import ResolvedKit
from stages.autoconfig.trial_search import TrialResult
from stages.exemplars.identify import identify_parts
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig
from stages.shape.resolved_settings import FALLBACK_KEY, FALLBACK_STABLE_KEY, ROWS_FALLBACK
from tests.stages.rows import models
from tests.toy_kits.chains_and_rings import Placed, chain, models_of

LINKS = {"cap": trimesh.creation.box((0.5, 1.0, 1.0)), "link": trimesh.creation.box((1.0, 0.2, 0.6))}


def fallback_of(meshes: dict[str, trimesh.Trimesh], parts: list[Placed], pair_distance: float) -> ResizeFallback | None:
    """Return the fallback of a model in which a search has found enough layouts, which differ by `pair_distance`."""
    contact = ContactConfig(kinds=("point", "line", "face"))
    config = KitConfig(name="toy", shapes=(Path(__file__),), contact=contact).resolve({**STRICTEST, "up": "y"})
    read = models_of(meshes, [parts])
    values = {"hubs.types": "none", "disconnected": "error"}
    trial = TrialResult(1000, 300, 200, 0.2, pair_distance)
    resolution = Resolution(values, dict.fromkeys(values, "a reason"), trial, 1.0, True, 1)
    return resize_fallback(ResolvedKit(config, read, identify_parts(read, config), resolution), None, 0)


def test_bays_of_modules_replace_layouts_that_look_alike() -> None:
    fallback = fallback_of(*models.tower_parts(), MAX_ALIKE_DISTANCE)
    assert fallback is not None
    assert fallback.resolution.values[FALLBACK_KEY] == ROWS_FALLBACK
    assert fallback.resolution.values[FALLBACK_STABLE_KEY] is True
    assert ALIKE in fallback.resolution.reasons[FALLBACK_KEY]
    assert fallback.estimate.shares == {"longer or shorter": pytest.approx(1.0)}
    assert "bays of" in fallback.estimate.sentence


def test_layouts_that_differ_are_kept() -> None:
    assert fallback_of(*models.tower_parts(), MAX_ALIKE_DISTANCE + 0.01) is None


def test_rows_are_left_to_the_search_which_finds_them() -> None:
    assert fallback_of(LINKS, [(name, np.asarray(at)) for name, at in chain(5)], 0.0) is None
