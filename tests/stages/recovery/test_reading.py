"""Inputs that are read as clouds or drawings, and the errors for others."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw

from pipeline.shards import ShardWriter, array_bytes
from stages.recovery.inputs import InputError, RecoveryInput, checked_cloud, ink_from_picture
from stages.recovery.reading import read_inputs
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS, fit_to_square

RNG = np.random.default_rng(0)
CLOUD = RNG.normal(size=(200, 3))


def drawing(size: int = 300) -> np.ndarray:
    """A house, dark on white."""
    image = Image.new("L", (size, size), 255)
    pen = ImageDraw.Draw(image)
    low, high = size // 4, 3 * size // 4
    pen.rectangle((low, low, high, high), outline=0, width=max(size // 100, 1))
    pen.line((low, low, size // 2, size // 10, high, low), fill=0, width=max(size // 100, 1))
    return np.asarray(image)


def only(path: Path) -> RecoveryInput | InputError:
    (found,) = read_inputs(path)
    return found


@pytest.mark.parametrize("suffix", [".npy", ".xyz", ".csv", ".ply"])
def test_clouds_are_read_from_files(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"scan{suffix}"
    if suffix == ".npy":
        np.save(path, np.hstack([CLOUD, CLOUD]))  # with normals
    elif suffix == ".ply":
        trimesh.PointCloud(CLOUD).export(path)
    else:
        np.savetxt(path, CLOUD, delimiter="," if suffix == ".csv" else " ")
    found = only(path)
    assert isinstance(found, RecoveryInput)
    assert found.name == "scan"
    assert found.points is not None
    assert np.allclose(found.points, CLOUD, atol=1e-6)


def test_mesh_is_sampled_on_its_surface(tmp_path: Path) -> None:
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "box.glb")
    found = only(tmp_path / "box.glb")
    assert isinstance(found, RecoveryInput)
    assert found.points is not None
    assert np.allclose(np.abs(found.points).max(axis=1), 1.0)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.empty((0, 3)), "is empty"),
        (np.zeros((1, 3)), "has 1 point: a cloud needs at least 32"),
        (np.zeros((40, 3)), "all 40 points are at one place"),
        (np.where(np.arange(120).reshape(40, 3) == 7, np.nan, CLOUD[:40]), "1 of 40 points are not finite"),
        (np.where(np.arange(120).reshape(40, 3) == 7, np.inf, CLOUD[:40]), "1 of 40 points are not finite"),
        (CLOUD[:, :2], r"a cloud is \(points, 3\)"),
        (np.array([["a", "b", "c"]] * 40), "holds no numbers"),
    ],
)
def test_invalid_clouds_are_reported(points: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_cloud(points)


@pytest.mark.parametrize("size", [40, 300, 1500])
@pytest.mark.parametrize("inverted", [False, True])
def test_drawings_of_any_size_and_polarity_are_similar(size: int, inverted: bool) -> None:
    picture = 255 - drawing(size) if inverted else drawing(size)
    found, expected = ink_from_picture(picture), ink_from_picture(drawing())
    assert found.shape == (DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS)
    rows, columns = np.nonzero(found)
    assert max(np.ptp(rows), np.ptp(columns)) >= DRAWING_SIDE_PIXELS - 2 * 8 - 3
    far = 10 if size == 40 else 3  # a line of a pixel of forty is wide
    for ink, other in ((found, expected), (expected, found)):
        near = np.zeros_like(other)
        for row, column in np.argwhere(other):
            near[max(row - far, 0) : row + far + 1, max(column - far, 0) : column + far + 1] = True
        assert near[ink].all()


def test_fitted_ink_does_not_depend_on_its_margins() -> None:
    ink = drawing() < 128
    larger = np.pad(ink, ((10, 200), (300, 0)))
    assert np.array_equal(fit_to_square(ink), fit_to_square(larger))


def test_invalid_drawings_are_reported(tmp_path: Path) -> None:
    photograph = RNG.integers(0, 255, (64, 64, 3)).astype(np.uint8)
    with pytest.raises(InputError, match="in colour"):
        ink_from_picture(photograph)
    with pytest.raises(InputError, match="a photograph, or shaded"):
        ink_from_picture(photograph[..., 0])
    with pytest.raises(InputError, match="blank"):
        ink_from_picture(np.full((64, 64), 200, np.uint8))
    Image.new("1", (20_000, 10), 1).save(tmp_path / "long.png")
    assert "20,000 × 10 pixels: a drawing has at most 8,192" in str(only(tmp_path / "long.png"))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    assert "is no picture" in str(only(tmp_path / "broken.png"))


def test_transparent_drawings_are_on_white(tmp_path: Path) -> None:
    layers = np.zeros((300, 300, 4), np.uint8)
    layers[..., 3] = 255 - drawing()
    Image.fromarray(layers).save(tmp_path / "house.png")
    found = only(tmp_path / "house.png")
    assert isinstance(found, RecoveryInput)
    assert np.array_equal(found.ink, ink_from_picture(drawing()))


def test_folder_is_read_in_order_despite_a_bad_file(tmp_path: Path) -> None:
    np.save(tmp_path / "b.npy", CLOUD)
    np.save(tmp_path / "a.npy", CLOUD[:3])
    Image.fromarray(drawing()).save(tmp_path / "c.png")
    (tmp_path / "notes.md").write_text("not an input", encoding="utf-8")
    first, second, third = read_inputs(tmp_path)
    assert isinstance(first, InputError)
    assert isinstance(second, RecoveryInput)
    assert second.points is not None
    assert isinstance(third, RecoveryInput)
    assert third.ink is not None


def test_shard_gives_the_clouds_of_its_samples(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with ShardWriter(stream) as writer:
        writer.write("chair-000000", {"points.npy": array_bytes(CLOUD.astype(np.float32))})
        writer.write("chair-000001", {"txt": b"{}"})
    (tmp_path / "chairs.tar").write_bytes(stream.getvalue())
    first, second = read_inputs(tmp_path / "chairs.tar")
    assert isinstance(first, RecoveryInput)
    assert first.name == "chair-000000"
    assert isinstance(second, InputError)


def test_keys_that_are_paths_are_refused_and_folders_skipped(tmp_path: Path) -> None:
    content = array_bytes(CLOUD)
    with tarfile.open(tmp_path / "foreign.tar", "w") as tar:
        folder = tarfile.TarInfo("clouds")
        folder.type = tarfile.DIRTYPE
        tar.addfile(folder)
        for key in ("/tmp/evil", "../evil", "clouds/evil", "clouds\\evil", "", "good"):
            entry = tarfile.TarInfo(f"{key}.points.npy")
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    *refused, good = read_inputs(tmp_path / "foreign.tar")
    assert len(refused) == 5
    assert all(isinstance(error, InputError) and "no file name" in str(error) for error in refused)
    assert isinstance(good, RecoveryInput)
    assert good.name == "good"


@pytest.mark.parametrize("name", ["nothing.ply", "text.md", "text.ply", "text.tar", "empty"])
def test_other_files_are_reported(name: str, tmp_path: Path) -> None:
    if name == "empty":
        (tmp_path / name).mkdir()
    elif not name.startswith("nothing"):
        (tmp_path / name).write_text("some text", encoding="utf-8")
    try:
        found = only(tmp_path / name)
    except InputError as error:
        found = error
    assert isinstance(found, InputError)
    assert name.partition(".")[0] in str(found)


def test_program_instead_of_a_drawing_is_not_executed(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n")
    assert "is no picture of PNG, JPEG, BMP, WEBP, TIFF, GIF but PostScript" in str(only(tmp_path / "a.png"))


def test_truncated_file_has_a_plain_message(tmp_path: Path) -> None:
    np.save(tmp_path / "cloud.npy", CLOUD)
    content = (tmp_path / "cloud.npy").read_bytes()
    (tmp_path / "cloud.npy").write_bytes(content[: len(content) // 2])
    assert str(only(tmp_path / "cloud.npy")).endswith("is no whole NumPy array of numbers; save it again")
    (tmp_path / "cloud.csv").write_text("1,2,3\n4,x,6\n", encoding="utf-8")
    assert str(only(tmp_path / "cloud.csv")).startswith(f"{tmp_path}/cloud.csv: line 2: 'x' is no number")
