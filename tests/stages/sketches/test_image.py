from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from stages.shape.views.image_files import png_bytes
from stages.sketches.image import augment, dilate, erode, flip
from stages.sketches.settings import Augmentation
from tests.stages.sketches.png import png_array

SIZES = st.tuples(st.integers(1, 40), st.integers(1, 40), st.integers(0, 9999))


def noise(height, width, seed):
    return np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)


@settings(max_examples=20, deadline=None)
@given(SIZES)
def test_png_keeps_every_pixel_and_gives_the_same_bytes_again(size):
    drawing = noise(*size)
    content = png_bytes(drawing)
    assert (png_array(content) == drawing).all()
    assert png_bytes(drawing.copy()) == content


def test_a_png_is_single_channel_8_bit_and_has_no_time_or_program_in_it():
    content = png_bytes(noise(5, 7, 0))
    assert content[16:29] == bytes([0, 0, 0, 7, 0, 0, 0, 5, 8, 0, 0, 0, 0])
    for chunk in (b"tIME", b"tEXt", b"iTXt", b"zTXt"):
        assert chunk not in content


def test_what_is_no_image_is_refused():
    with pytest.raises(ValueError, match="not an image"):
        png_array(b"no image at all")


@given(SIZES)
def test_flipping_twice_changes_nothing(size):
    drawing = noise(*size)
    assert (flip(flip(drawing)) == drawing).all()


@settings(max_examples=20, deadline=None)
@given(SIZES, st.sampled_from([3, 5]))
def test_dilate_takes_the_darkest_and_erode_the_lightest_of_the_neighbourhood(size, side):
    drawing = noise(*size)
    assert (dilate(drawing, side) == ndimage.minimum_filter(drawing, side, mode="nearest")).all()
    assert (erode(drawing, side) == ndimage.maximum_filter(drawing, side, mode="nearest")).all()


def test_augmentations_come_with_their_probabilities():
    drawing = np.full((9, 9), 255, dtype=np.uint8)
    drawing[4, 1] = 0
    chances = Augmentation(flip=0.5, dilate=0.25, erode=0.25)
    made = [augment(drawing, chances, np.random.default_rng(seed)).drawing for seed in range(400)]
    flipped = np.mean([(drawing[:, 5:] < 255).any() for drawing in made if drawing.min() < 255])
    dark = np.array([(drawing < 255).sum() for drawing in made])
    assert abs(flipped - 0.5) < 0.1
    assert abs((dark == 9).mean() - 0.25) < 0.08
    assert abs((dark == 0).mean() - 0.25) < 0.08


def test_without_chances_nothing_changes():
    drawing = noise(8, 8, 1)
    assert (augment(drawing, Augmentation(), np.random.default_rng(0)).drawing == drawing).all()
