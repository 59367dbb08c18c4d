"""Contact sheets: titled rows of pictures with captions on one sheet of paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil
from typing import Any

import numpy as np

from stages.shape.arrays import ByteArray
from stages.shape.views.palette import PAPER

TITLE_INK = (32, 30, 34)
CAPTION_INK = (122, 116, 112)
RULE_COLOR = (226, 221, 213)
MIN_NOTE_WIDTH = 180
"""Pixels next to a title, of a cell of 320, that a note has at least."""

MIN_CONTRAST_LEVELS = 12
"""Pixels that differ more from the background are content, of 255."""
CELL_PAD_SHARE = 0.02
"""Strip above and below the content of a row, as a share of the pictures' height."""


@dataclass(frozen=True)
class Cell:
    """A picture, uint8 (h, w) or (h, w, 3), and a caption (may be empty)."""

    picture: ByteArray
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """Rows of cells under a heading.

    note: small print next to the heading
    span: width of a cell in columns
    """

    title: str
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    span: int = 1


def contact_sheet(sections: Sequence[Section], title: str = "", cell_width: int = 320) -> ByteArray:
    """Return the sheet, uint8 (h, w, 3).

    Pictures are scaled to `cell_width` pixels (times the section's span, with the gaps between). Rows of unequal length
    stay ragged. If titles are longer than rows, the sheet is as wide as they are. Margins and letters grow with
    `cell_width`. Raises ValueError for no pictures.
    """
    from PIL import Image, ImageDraw

    columns = max((section.span * len(row) for section in sections for row in section.rows), default=0)
    if columns == 0:
        raise ValueError("a contact sheet needs at least one picture")
    unit = cell_width / 320
    margin, gap = round(40 * unit), round(16 * unit)
    fonts = {"title": _font(round(30 * unit), True), "head": _font(round(19 * unit), True)}
    fonts |= {"caption": _font(round(13.5 * unit), False), "note": _font(round(14 * unit), False)}
    width = 2 * margin + max(columns * cell_width + (columns - 1) * gap, _longest(sections, title, fonts, unit))
    widths = [section.span * (cell_width + gap) - gap for section in sections]
    heights = _row_heights(sections, widths, unit)
    notes = [_note_lines(section, fonts, width - 2 * margin, unit) for section in sections]
    leading = round(19 * unit)
    heads = [round(66 * unit) + leading * (len(lines) - 1) for lines in notes]
    height = 2 * margin + (round(62 * unit) if title else 0)
    for section, rows, head in zip(sections, heights, heads, strict=True):
        height += (head if section.title else 0) + sum(rows) + gap * len(rows)
    sheet = Image.new("RGB", (width, height), PAPER)
    pen = ImageDraw.Draw(sheet)
    y = margin
    if title:
        pen.text((margin, y), title, TITLE_INK, fonts["title"])
        y += round(62 * unit)
    for section, across, section_heights, lines, head in zip(sections, widths, heights, notes, heads, strict=True):
        if section.title:
            pen.line(
                [(margin, y + round(8 * unit)), (width - margin, y + round(8 * unit))], RULE_COLOR, max(1, round(unit))
            )
            pen.text((margin, y + round(24 * unit)), section.title, TITLE_INK, fonts["head"])
            after = margin + _after(section, fonts, unit)
            for number, line in enumerate(lines):
                pen.text((after, y + round(28.5 * unit) + number * leading), line, CAPTION_INK, fonts["note"])
            y += head
        for row, row_height in zip(section.rows, section_heights, strict=True):
            for index, cell in enumerate(row):
                x = margin + index * (across + gap)
                picture = _scaled(cell.picture, across)
                sheet.paste(picture, (x, y))
                line = _fitting(pen, cell.caption, fonts["caption"], across)
                middle = (across - pen.textlength(line, fonts["caption"])) / 2
                pen.text((x + middle, y + picture.height + round(7 * unit)), line, CAPTION_INK, fonts["caption"])
            y += row_height + gap
    return np.asarray(sheet)


def trimmed(row: Sequence[Cell]) -> list[Cell]:
    """Crop the pictures of a row to one strip that holds the content of all."""
    tops, ends = [], []
    for cell in row:
        height = len(cell.picture)
        marked = (
            (np.abs(cell.picture.astype(np.int16) - cell.picture[0, 0]) > MIN_CONTRAST_LEVELS)
            .reshape(height, -1)
            .any(axis=1)
        )
        content_rows = np.flatnonzero(marked)
        tops.append(content_rows[0] / height if len(content_rows) else 0.5)
        ends.append((content_rows[-1] + 1) / height if len(content_rows) else 0.5)
    top, end = max(min(tops) - CELL_PAD_SHARE, 0.0), min(max(ends) + CELL_PAD_SHARE, 1.0)
    return [
        Cell(cell.picture[round(top * len(cell.picture)) : round(end * len(cell.picture))], cell.caption)
        for cell in row
    ]


def picture_png(picture: ByteArray) -> bytes:
    """Return a picture, uint8 (h, w) or (h, w, 3), as PNG; equal pictures give equal bytes."""
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG")
    return stream.getvalue()


def _row_heights(sections: Sequence[Section], widths: Sequence[int], unit: float) -> list[list[int]]:
    heights = []
    for section, width in zip(sections, widths, strict=True):
        rows = []
        for row in section.rows:
            caption = round(30 * unit) if any(cell.caption for cell in row) else 0
            tallest = max(round(cell.picture.shape[0] * width / cell.picture.shape[1]) for cell in row)
            rows.append(tallest + caption)
        heights.append(rows)
    return heights


def _scaled(picture: ByteArray, width: int) -> Any:
    """Return a PIL image of the given width; the paper shows through the white of drawings of one channel."""
    from PIL import Image

    image = Image.fromarray(picture)
    height = round(image.height * width / image.width)
    if image.size != (width, height):
        image = image.resize((width, height), Image.Resampling.LANCZOS)
    if image.mode == "L":
        light = np.asarray(image)[..., None] / 255.0
        image = Image.fromarray(np.rint(light * np.array(PAPER)).astype(np.uint8))
    return image


def _longest(sections: Sequence[Section], title: str, fonts: Mapping[str, Any], unit: float) -> int:
    """Return the pixels that titles take, with a minimum for the notes next to them."""
    lengths: list[float] = [fonts["title"].getlength(title)]
    lengths += [fonts["head"].getlength(section.title) for section in sections]
    lengths += [
        _after(section, fonts, unit) + MIN_NOTE_WIDTH * unit for section in sections if section.title and section.note
    ]
    return ceil(max(lengths))


def _after(section: Section, fonts: Mapping[str, Any], unit: float) -> float:
    """Return where the note of a section begins, relative to its title."""
    length: float = fonts["head"].getlength(section.title) + 14 * unit
    return length


def _note_lines(section: Section, fonts: Mapping[str, Any], width: int, unit: float) -> list[str]:
    """Return the note of a section in lines that fit next to its title; a longer word gets a line of its own."""
    room = width - _after(section, fonts, unit)
    lines: list[str] = []
    for word in section.note.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and fonts["note"].getlength(longer) <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _fitting(pen: Any, text: str, font: Any, width: int) -> str:
    """Return `text`, cut with an ellipsis to fit the width."""
    if pen.textlength(text, font) <= width:
        return text
    while text and pen.textlength(text + "…", font) > width:
        text = text[:-1]
    return text + "…"


@lru_cache(maxsize=16)
def _font(size: int, bold: bool) -> Any:
    """Return DejaVu Sans from matplotlib: the same letters on every machine."""
    from matplotlib import get_data_path
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = f"{get_data_path()}/fonts/ttf/{name}"
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)
