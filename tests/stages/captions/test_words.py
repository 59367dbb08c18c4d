"""Words of captions."""

from __future__ import annotations

import pytest

from stages.captions.words import color_name, counted, label_nouns, number_word, source_noun, word_number


def test_numbers_are_words_up_to_twelve_and_come_back() -> None:
    assert [number_word(number) for number in (1, 12, 13)] == ["one", "twelve", "13"]
    assert all(word_number(number_word(number)) == number for number in range(200))
    assert word_number("an") == 1


@pytest.mark.parametrize(
    ("count", "noun", "words"),
    [
        (1, "arm", "an arm"),
        (2, "shelf", "two shelves"),
        (3, "back leg", "three back legs"),
        (1, "glass", "a pane of glass"),
        (2, "glass", "two panes of glass"),
        (2, "bridge planks", "two sets of bridge planks"),
        (1, "cross", "a cross"),
        (14, "balcony", "14 balconies"),
    ],
)
def test_things_are_counted_in_english(count: int, noun: str, words: str) -> None:
    assert counted(count, noun) == words


def test_nouns_are_the_words_of_labels_and_unique() -> None:
    paths = ["Chair/Base/back_leg", "Bench/Seat/board", "Bench/Back/board"]
    labels = [*paths, "column_upper", "towerBase", "part_7", "x-12", "revolution", "sweep"]
    assert label_nouns(labels) == {
        "Chair/Base/back_leg": "back leg",
        "Bench/Seat/board": "seat board",
        "Bench/Back/board": "back board",
        "column_upper": "upper column",
        "towerBase": "tower base",
        "revolution": "turned solid",
        "sweep": "swept bar",
    }
    assert label_nouns(["arm-rest", "arm rest"]) == {}, "two labels with one noun would be counted as one"


def test_a_shape_is_called_by_the_config_by_its_paths_or_by_its_source() -> None:
    assert source_noun("furniture", ["Chair/seat", "Chair/Base/leg"], {}) == "chair"
    assert source_noun("space-base", ["hub"], {}) == "space base"
    assert source_noun("primitives", ["box"], {}) == "shape", "a source whose name is a plural"
    assert source_noun("space-base", ["hub"], {"space-base": "space station"}) == "space station"


@pytest.mark.parametrize(
    ("color", "name"),
    [
        ((255, 0, 0), "red"),
        ((40, 60, 200), "blue"),
        ((30, 160, 60), "green"),
        ((128, 128, 128), "grey"),
        ((250, 250, 248), "white"),
        ((10, 12, 11), "black"),
        ((120, 80, 40), "brown"),
        ((205, 172, 128), "light brown"),
        ((235, 220, 190), "beige"),
        ((240, 200, 40), "yellow"),
    ],
)
def test_colors_have_their_common_names(color: tuple[int, int, int], name: str) -> None:
    assert color_name(color) == name


def test_a_color_between_two_names_has_none() -> None:
    names = [color_name((level, level, level)) for level in (200, 217, 230)]
    assert names == ["light grey", "", "white"]
