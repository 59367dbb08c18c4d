"""The checks of `make verify` find views that are not those of their sample."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pipeline.paths import DatasetPaths
from stages.shape.collection.packaged import PackagedSample
from stages.shape.views.image_files import data_png_bytes
from stages.views.audit import AUDIT
from stages.views.reading import read_view
from stages.views.settings import ViewsConfig
from tests.stages.views.rendered import CAMERAS, files_of, lopsided, wires

SHAPE = lopsided()
KEYS = {
    "cameras": CAMERAS[:1],
    "width": 96,
    "height": 80,
    "images": ["color", "depth", "normals", "instances", "classes", "mask"],
    "color": {"background": "transparent"},
}
FILES, CAMERAS_OF = files_of(SHAPE, ViewsConfig.model_validate(KEYS))


def sample(files: dict[str, bytes], cameras: list[dict[str, Any]]) -> PackagedSample:
    parts = [{"class": int(number)} for number in SHAPE.part_classes]
    return PackagedSample("a-1", {"parts": parts, "views": cameras}, files, {}, SHAPE, {"views": KEYS})


def faults(files: dict[str, bytes], cameras: list[dict[str, Any]], tmp: Any) -> list[str]:
    packaged = sample(files, cameras)
    return [*AUDIT.faults(packaged), *AUDIT.recheck(packaged, DatasetPaths(tmp, "a"))]


def erased(color: np.ndarray) -> bytes:
    """Return a colour image without a square in the middle of the shape."""
    rows, columns = (int(np.median(places)) for places in np.nonzero(color[..., 3] == 255))
    hole = color.copy()
    hole[rows - 2 : rows + 3, columns - 2 : columns + 3] = 0
    stream = io.BytesIO()
    Image.fromarray(hole).save(stream, "PNG")
    return stream.getvalue()


def shifted_ids(ids: np.ndarray) -> bytes:
    return data_png_bytes(np.where(ids >= 0, (ids + 1) % 4 + 1, 0).astype(np.uint16))


CHANGES: dict[str, tuple[Callable[[dict[str, bytes]], None], str]] = {
    "the depth of the next view": (lambda files: files.update({"depth0.png": FILES["depth1.png"]}), "other pixels"),
    "other parts": (
        lambda files: files.update({"instances0.png": shifted_ids(read_view(FILES, 0)["instances"])}),
        "classes that are not those",
    ),
    "a hole in the colour": (
        lambda files: files.update({"color0.png": erased(read_view(FILES, 0)["color"])}),
        "no colour where depth shows the shape",
    ),
    "all of the next view": (
        lambda files: files.update({name: FILES[name.replace("0", "1")] for name in FILES if "0" in name}),
        "rays do not meet",
    ),
    "a truncated file": (lambda files: files.update({"normals0.png": FILES["normals0.png"][:60]}), "cannot be read"),
    "an empty mask": (lambda files: files.update({"mask0.png": data_png_bytes(np.zeros((80, 96), np.uint8))}), "mask"),
    "a small mask": (lambda files: files.update({"mask0.png": data_png_bytes(np.ones((8, 9), np.uint8))}), "pixels"),
}


def test_the_views_of_a_sample_have_no_faults(tmp_path: Any) -> None:
    assert faults(FILES, CAMERAS_OF, tmp_path) == []


def test_what_is_thinner_than_a_pixel_makes_no_fault() -> None:
    files, cameras = files_of(wires(), ViewsConfig.model_validate(KEYS))
    parts = [{"class": 0}] + 8 * [{"class": 1}]
    packaged = PackagedSample("a-1", {"parts": parts, "views": cameras}, files, {}, wires(), {"views": KEYS})
    depth, alpha = read_view(files, 0)["depth"], read_view(files, 0)["color"][..., 3]
    assert ((depth > 0) & (alpha == 0)).any(), "a wire is at the centre of a pixel and at none of its samples of colour"
    assert [*AUDIT.faults(packaged)] == []


@pytest.mark.parametrize("change", CHANGES)
def test_wrong_images_are_found(change: str, tmp_path: Any) -> None:
    files = dict(FILES)
    CHANGES[change][0](files)
    found = [*AUDIT.faults(sample(files, CAMERAS_OF))] or faults(files, CAMERAS_OF, tmp_path)
    assert any(CHANGES[change][1] in fault for fault in found), found


def test_a_camera_that_is_a_little_wrong_is_found(tmp_path: Any) -> None:
    cameras = [dict(camera) for camera in CAMERAS_OF]
    pose = np.array(cameras[0]["world_to_camera"])
    pose[2, 3] += 0.2
    cameras[0]["world_to_camera"] = pose.tolist()
    assert any("depth that rays do not meet" in fault for fault in faults(FILES, cameras, tmp_path))
