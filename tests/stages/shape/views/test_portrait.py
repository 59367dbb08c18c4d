from __future__ import annotations

import numpy as np
import pytest

from stages.shape.views.camera import Camera
from stages.shape.views.palette import PAPER, label_colors, linear_to_srgb, srgb_to_linear
from stages.shape.views.portrait import points_portrait, portrait
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from tests.stages.shape.views.solids import boxes_scene

CAMERA = Camera(-35.0, 28.0)


def test_a_portrait_is_deterministic_and_of_the_size_asked():
    scene = boxes_scene([(0, 0, 0), (1, 0, 0)], edges=[(0, 1)])
    one, two = (portrait(scene, CAMERA, (96, 64), renderer="raster") for _ in range(2))
    assert one.shape == (64, 96, 3)
    assert one.dtype == np.uint8
    assert (one == two).all()


def test_a_portrait_has_paper_around_a_lit_top_a_darker_side_and_a_shadow_on_the_ground():
    picture = portrait(boxes_scene([(0, 0, 0)]), CAMERA, (160, 160), renderer="raster").astype(int)
    assert (picture[:6, :6] == PAPER).all()
    top, left, right = (picture[row, column].sum() for row, column in ((30, 80), (80, 40), (80, 100)))
    shadow, paper = picture[95, 147].sum(), sum(PAPER)
    assert paper > top > left > right
    assert right < shadow < paper - 50


def test_part_colours_replace_those_of_the_faces():
    scene = boxes_scene([(0, 0, 0)])
    blue = np.array([[20, 40, 220]], dtype=np.uint8)
    picture = portrait(scene, CAMERA, (64, 64), part_colors=blue, renderer="raster")
    assert picture[32, 32, 2] > picture[32, 32, 0] + 50


def test_points_are_balls_in_the_colour_of_their_label():
    points = np.array([[0.0, 0, 0], [1, 0, 0]])
    picture = points_portrait(points, np.array([0, 1], dtype=np.int32), Camera(0.0, 0.0), (200, 120), "y")
    left, right = picture[60, :100], picture[60, 100:]
    hues = [row[(row != PAPER).any(axis=1)].astype(float).mean(axis=0) for row in (left, right)]
    expected = label_colors(2).astype(float)
    for hue, color in zip(hues, expected, strict=True):
        assert np.argmax(hue) == np.argmax(color)
        assert np.argmin(hue) == np.argmin(color)


def test_label_colours_are_distinct_and_do_not_depend_on_how_many_there_are():
    colors = label_colors(24).astype(int)
    assert (label_colors(5) == colors[:5]).all()
    gaps = np.abs(colors[:, None] - colors[None]).sum(axis=2) + 999 * np.eye(24, dtype=int)
    assert gaps.min() > 12


def test_srgb_survives_the_way_to_linear_light_and_back():
    levels = np.arange(256, dtype=np.uint8)
    assert (linear_to_srgb(srgb_to_linear(levels)) == levels).all()


def test_sheet_places_pictures_by_row_and_column():
    red = np.zeros((20, 40, 3), dtype=np.uint8) + np.array([220, 0, 0], dtype=np.uint8)
    drawing = np.full((40, 40), 255, dtype=np.uint8)
    sheet = contact_sheet([Section("Title", [[Cell(red, "caption"), Cell(drawing)]])], "Sheet", cell_width=40)
    reds = np.argwhere((sheet == [220, 0, 0]).all(axis=2))
    assert len(reds) == 20 * 40
    assert (np.ptp(reds, axis=0) == (19, 39)).all()
    assert (sheet[reds[0, 0], reds[0, 1] + 60] == PAPER).all()
    assert picture_png(sheet) == picture_png(sheet.copy())


def test_a_sheet_without_pictures_is_refused():
    with pytest.raises(ValueError, match="at least one picture"):
        contact_sheet([Section("Title", [])])


def test_a_note_that_is_longer_than_the_sheet_is_wrapped():
    picture = np.zeros((40, 400, 3), dtype=np.uint8)
    short, long = (
        contact_sheet([Section("Title", [[Cell(picture)]], " ".join(["note"] * words))], cell_width=400)
        for words in (3, 60)
    )
    assert long.shape[1] == short.shape[1]
    assert long.shape[0] > short.shape[0]
    assert (long[:, -10:] == PAPER).all()
