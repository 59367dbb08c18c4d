"""Nothing that is written on a sheet is cut off by its edge."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.arrays import BoolArray, ByteArray
from stages.shape.views.portrait import PAPER
from stages.shape.views.sheet import Cell, Section, contact_sheet

WHITE: ByteArray = np.full((90, 120, 3), PAPER, np.uint8)
LONG = "Shapes of a grammar that has a name of many words, and of a radius"


def written(sheet: ByteArray) -> BoolArray:
    ink: BoolArray = (sheet != np.array(PAPER, np.uint8)).any(axis=2)
    return ink


@pytest.mark.parametrize("title", ["", LONG])
@pytest.mark.parametrize("head", ["", LONG])
@pytest.mark.parametrize("note", ["", f"{LONG}; {LONG}"])
@pytest.mark.parametrize("cell", [120, 320])
def test_a_sheet_of_one_picture_is_as_wide_as_its_titles(title: str, head: str, note: str, cell: int) -> None:
    ink = written(contact_sheet([Section(head, [[Cell(WHITE)]], note)], title, cell))
    margin = round(40 * cell / 320)
    # but for the rule, one line right across to the margin
    assert not ink[:, -margin + 1 :].any()
    assert not ink[-margin + 1 :].any()


def test_short_titles_leave_the_width_to_the_pictures() -> None:
    plain = contact_sheet([Section("", [[Cell(WHITE)] * 3])])
    titled = contact_sheet([Section("A head", [[Cell(WHITE)] * 3], "and a note")], "A title")
    assert plain.shape[1] == titled.shape[1] == 2 * 40 + 3 * 320 + 2 * 16


def test_a_sheet_needs_a_picture() -> None:
    with pytest.raises(ValueError, match="at least one picture"):
        contact_sheet([Section("empty", [])])
