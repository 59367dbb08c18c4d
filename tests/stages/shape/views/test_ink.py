from __future__ import annotations

import numpy as np
import pytest

from stages.shape.views.ink import ink_strokes
from stages.shape.views.strokes import BOUNDARY_LINE, CREASE_LINE, OUTLINE_LINE, Strokes


def line(*ends, kind=OUTLINE_LINE):
    return Strokes(np.array(ends, dtype=float).reshape(-1, 2, 2), np.full(len(ends), kind, dtype=np.uint8))


@pytest.mark.parametrize("width", [0.4, 1.0, 1.8, 3.0])
@pytest.mark.parametrize("angle", [0.0, 17.0, 45.0, 90.0])
def test_a_line_has_the_width_it_is_given_at_every_angle(width, angle):
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    ends = np.array([[50.3, 50.6] - 40 * way, [50.3, 50.6] + 40 * way])
    ink = ink_strokes(line(ends), {OUTLINE_LINE: width}, 100, 100, 1.0, 0.0)
    rows, columns = np.mgrid[:100, :100] + 0.5
    along = (columns - 50.3) * way[0] + (rows - 50.6) * way[1]
    middle = np.abs(along) < 25
    assert ink[middle].sum() / 50 == pytest.approx(width, rel=0.04)


def test_pieces_of_a_line_are_as_dark_as_the_whole():
    whole = ink_strokes(line([[5, 7.3], [45, 7.3]]), {OUTLINE_LINE: 1.4}, 50, 16, 1.0, 0.0)
    cuts = np.linspace(5, 45, 81)
    pieces = np.stack([np.stack([cuts[:-1], np.full(80, 7.3)], 1), np.stack([cuts[1:], np.full(80, 7.3)], 1)], 1)
    assert np.allclose(ink_strokes(line(*pieces), {OUTLINE_LINE: 1.4}, 50, 16, 1.0, 0.0), whole)


def test_lines_beyond_the_picture_are_cut_off():
    ink = ink_strokes(line([[-30, -30], [60, 60]], [[200, 5], [300, 5]]), {OUTLINE_LINE: 1.0}, 20, 10, 1.0, 0.0)
    assert ink.shape == (10, 20)
    assert ink[5, 5] > 0.9
    assert ink[0, 19] == 0.0


def test_a_kind_without_a_width_is_not_drawn():
    assert ink_strokes(line([[1, 1], [9, 9]], kind=CREASE_LINE), {OUTLINE_LINE: 1.0}, 10, 10, 1.0, 3.0).max() == 0.0


def test_crowded_inner_lines_fade_and_a_lonely_one_does_not():
    def hatch(spacing):
        return line(*[[[x, 2], [x, 62]] for x in np.arange(8, 56, spacing)], kind=BOUNDARY_LINE)

    def darkest(spacing, crowding):
        return ink_strokes(hatch(spacing), {BOUNDARY_LINE: 1.0}, 64, 64, 1.0, crowding)[20:44, 16:48].max()

    # Whole lines are one segment here, so each counts in the cell of its middle; cut them up as strokes are.
    dense = np.concatenate([[[[x, y], [x, y + 0.5]] for y in np.arange(2, 62, 0.5)] for x in np.arange(8.5, 56, 1.5)])
    faded = ink_strokes(line(*dense, kind=BOUNDARY_LINE), {BOUNDARY_LINE: 1.0}, 64, 64, 1.0, 3.0)[20:44, 20:44]
    assert faded.max() == pytest.approx(0.5, abs=0.1)
    single = np.array([[[30.5, y], [30.5, y + 0.5]] for y in np.arange(2, 62, 0.5)])
    assert ink_strokes(line(*single, kind=BOUNDARY_LINE), {BOUNDARY_LINE: 1.0}, 64, 64, 1.0, 3.0)[20:44].max() > 0.99
    assert darkest(1.5, 0.0) > 0.99
