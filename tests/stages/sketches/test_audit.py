"""What `make verify` finds wrong with the drawings of a sample, and that it finds nothing wrong with good ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.views.image_files import png_bytes
from stages.sketches.audit import AUDIT
from stages.sketches.settings import Augmentation
from tests.stages.sketches.png import png_array
from tests.stages.sketches.test_cameras import VIEWS, lopsided, sketch

LINE_WIDTH_PIXELS = 1.8
"""Width of the widest line that `StrokeOptions` draws when nobody asks for another; pixels."""


def sample(view: str = "perspective", chances: Augmentation | None = None) -> PackagedSample:
    drawn = sketch(view, "z", chances)
    camera = {"view": view, **drawn.camera, "line_width": LINE_WIDTH_PIXELS + drawn.thicker}
    record = {"bounds": shape_bounds(lopsided("z")).tolist(), "sketches": [camera]}
    return PackagedSample("a", record, {"sketch0.png": png_bytes(drawn.pixels)}, {}, lopsided("z"), {})


def redrawn(good: PackagedSample, change: Callable[[np.ndarray], np.ndarray]) -> PackagedSample:
    pixels = change(png_array(good.members["sketch0.png"]))
    return replace(good, members={"sketch0.png": png_bytes(pixels.astype(np.uint8))})


def recorded(good: PackagedSample, **changed: Any) -> PackagedSample:
    record = {**good.record, "sketches": [{**good.record["sketches"][0], **changed}]}
    return replace(good, record=record)


@pytest.mark.parametrize("chances", [None, Augmentation(flip=1.0, dilate=1.0, size=7)], ids=["plain", "augmented"])
@pytest.mark.parametrize("view", VIEWS)
def test_a_good_drawing_has_no_faults(view: str, chances: Augmentation | None) -> None:
    assert list(AUDIT.faults(sample(view, chances))) == []


@pytest.mark.parametrize(
    ("damage", "found"),
    [
        (lambda good: redrawn(good, lambda pixels: np.full_like(pixels, 255)), "blank"),
        (lambda good: redrawn(good, np.zeros_like), "full"),
        (lambda good: redrawn(good, lambda pixels: 255 - pixels), "full|beyond"),
        (lambda good: redrawn(good, lambda pixels: pixels[1:]), "not those of its record"),
        (lambda good: redrawn(good, lambda pixels: np.roll(pixels, 6, axis=1)), "beyond"),
        (lambda good: redrawn(good, lambda pixels: np.where(np.eye(len(pixels), dtype=bool), 0, pixels)), "beyond"),
        (lambda good: replace(good, members={"sketch0.png": b"no image"}), "cannot be read"),
        (lambda good: replace(good, members={"sketch0.png": good.members["sketch0.png"][:-40]}), "be read"),
        (lambda good: recorded(good, world_to_camera=(2 * np.eye(4)).tolist()), "not a rigid transform"),
        (lambda good: recorded(good, flipped=True), "contradict flipped"),
        (lambda good: recorded(good, world_to_camera=np.eye(4).tolist(), projection="orthographic"), "beyond"),
    ],
)
def test_a_damaged_drawing_is_found(damage: Callable[[PackagedSample], PackagedSample], found: str) -> None:
    with pytest.raises(AssertionError, match=f"sketch0.png .*({found})"):
        assert list(AUDIT.faults(damage(sample()))) == []
