"""Pictures are read as a viewer shows them: OpenImageIO is the oracle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from pipeline.errors import ConfigError
from stages.recovery.drawing_file import UNREAD_SUFFIXES, read_drawing
from stages.recovery.inputs import InputError, RecoveryInput, ink_from_picture
from stages.recovery.reading import read_inputs

CASES = Path(__file__).resolve().parents[3].parent / "shared" / "cases"
PAPER = Image.new("L", (300, 200), 255)
PEN = ImageDraw.Draw(PAPER)
PEN.rectangle((50, 40, 200, 150), outline=0, width=3)
PEN.line((50, 40, 290, 10), fill=0, width=3)
GREY = np.asarray(PAPER)
OPAQUE = 255 - GREY


def shown(path: Path) -> np.ndarray:
    """The picture on white, as OpenImageIO shows it: (h, w, 3)."""
    import OpenImageIO as oiio

    pixels = oiio.ImageBufAlgo.reorient(oiio.ImageBuf(str(path))).get_pixels("uint8").astype(int)
    if pixels.shape[2] in (2, 4):  # colours are multiplied by the alpha channel
        pixels = pixels[..., :-1] + 255 - pixels[..., -1:]
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels


PICTURES: dict[str, Callable[[Path], None]] = {
    "grey.png": PAPER.save,
    "sixteen.png": lambda path: Image.fromarray(GREY.astype(np.uint16) * 257).save(path),
    "sixteen.tif": lambda path: Image.fromarray(GREY.astype(np.uint16) * 257).save(path),
    "floats.tif": lambda path: Image.fromarray((GREY / 255).astype(np.float32)).save(path),
    "bits.png": PAPER.convert("1").save,
    "fax.tif": lambda path: PAPER.convert("1").save(path, compression="group4"),
    "alpha.png": lambda path: Image.fromarray(np.stack([0 * GREY, OPAQUE], axis=2)).save(path),
    "half.png": lambda path: Image.fromarray(np.stack([0 * GREY, OPAQUE // 2], axis=2)).save(path),
    "palette.png": lambda path: Image.fromarray(np.stack([*3 * [0 * GREY], OPAQUE], 2)).quantize(4).save(path),
    "ink.jpg": PAPER.convert("CMYK").save,
    "ink.tif": PAPER.convert("CMYK").save,
    "plain.bmp": PAPER.save,
}


@pytest.mark.parametrize("name", PICTURES)
def test_pixels_are_those_of_a_viewer(name: str, tmp_path: Path) -> None:
    PICTURES[name](tmp_path / name)
    drawing = read_drawing(tmp_path / name)
    assert np.abs(drawing.pixels - shown(tmp_path / name)).max() <= 3
    assert drawing.pixels.min() < 140 < 250 < drawing.pixels.max()
    assert drawing.warnings == ()


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tif"])
def test_pictures_are_turned_as_their_orientation_says(suffix: str, tmp_path: Path) -> None:
    found = []
    for orientation in range(1, 9):
        exif = Image.Exif()
        exif[0x112] = orientation
        path = tmp_path / f"turned{suffix}"
        PAPER.save(path, exif=exif)
        pixels = read_drawing(path).pixels
        assert np.abs(pixels - shown(path)).max() <= 3
        found.append((pixels[..., 0] < 128).tobytes())
    assert len(set(found)) == 8


def test_scale_of_wide_pixels_follows_the_highest(tmp_path: Path) -> None:
    for white in (255, 1023, 4095, 65535):
        Image.fromarray(np.where(GREY > 128, white, 0).astype(np.uint16)).save(tmp_path / "wide.png")
        assert set(np.unique(read_drawing(tmp_path / "wide.png").pixels)) == {0, 255}


def test_white_lines_on_nothing_are_drawn_on_black(tmp_path: Path) -> None:
    Image.fromarray(np.stack([0 * GREY + 255, OPAQUE], axis=2)).save(tmp_path / "white.png")
    pixels = read_drawing(tmp_path / "white.png").pixels
    assert np.array_equal(pixels[..., 0], OPAQUE)
    assert np.array_equal(ink_from_picture(pixels), ink_from_picture(GREY))


@pytest.mark.parametrize("name", ["pages.tif", "frames.gif", "frames.webp"])
def test_first_of_several_pages_is_taken_and_said(name: str, tmp_path: Path) -> None:
    PAPER.save(tmp_path / name, save_all=True, append_images=[PAPER.rotate(180)])
    (found,) = read_inputs(tmp_path / name)
    assert isinstance(found, RecoveryInput)
    assert found.warnings == ("the picture has 2 pages or frames: the first is taken",)
    assert np.abs(read_drawing(tmp_path / name).pixels - GREY[..., None].astype(int)).max() < 60


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("house.svg", b"<?xml version='1.0'?>\n<svg xmlns='http://www.w3.org/2000/svg'/>", "but an SVG; export it as"),
        ("house.pdf", b"%PDF-1.7\n", "but a PDF; export it as PNG"),
        ("phone.jpg", b"\0\0\0\x18ftypheic\0\0\0\0", "but HEIC; export it as PNG"),
        ("house.psd", b"8BPS\0\1", "Photoshop"),
        ("house.png", b"version https://git-lfs.github.com/spec/v1\nsize 9\n", "git lfs pull"),
        ("house.png", b"<!doctype html><html>", "web page"),
        ("house.png", b"", "empty"),
    ],
)
def test_other_formats_are_named_with_the_remedy(name: str, content: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError, match=words):
        read_drawing(tmp_path / name)
    (found,) = read_inputs(tmp_path / name)
    assert isinstance(found, InputError)


def test_every_unread_ending_is_tried_and_said(tmp_path: Path) -> None:
    for suffix in UNREAD_SUFFIXES:
        (tmp_path / f"house{suffix}").write_bytes(b"something else")
    found = list(read_inputs(tmp_path))
    assert len(found) == len(UNREAD_SUFFIXES)
    assert all("is no picture: none of PNG" in str(error) for error in found)


@pytest.mark.skipif(not CASES.is_dir(), reason="needs the shared material")
def test_turned_case_is_its_control() -> None:
    turned, upright = (
        ink_from_picture(read_drawing(CASES / f"drawing-{name}.jpg").pixels) for name in ("exif6", "upright")
    )
    assert (turned != upright).mean() < 0.01
