"""Words of captions: numbers, plurals, articles, names of colours, and nouns for labels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

NUMBERS = (
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve"),
)
IRREGULAR_PLURALS = {
    "shelf": "shelves",
    "leaf": "leaves",
    "half": "halves",
    "foot": "feet",
    "glass": "panes of glass",
    "stairs": "flights of stairs",
    "acroterion": "acroteria",
}
COUNTED_SINGULARS = {"glass": "pane of glass", "stairs": "flight of stairs"}
"""Nouns that are counted by another one."""
PLACES = {"upper", "lower", "left", "right", "front", "back", "rear", "inner", "outer", "middle"}
"""Words that come after a noun in labels, such as `column_upper`, and before it in English."""
UNUSABLE_WORDS = {
    *("and", "or", "with", "of", "in", "columns"),
    *("part", "parts", "piece", "object", "mesh", "type", "component"),
}
"""Words of labels that say nothing, or that would make a sentence ambiguous."""
PLAIN_WORDS = {"revolution": ["turned", "solid"], "sweep": ["swept", "bar"]}
"""Words that people say, for labels that name how a solid is made."""
HUES = (
    *((12, "red"), (42, "orange"), (70, "yellow"), (165, "green"), (195, "turquoise"), (255, "blue")),
    *((290, "purple"), (345, "pink"), (361, "red")),
)
"""Names of hues, each up to an angle in degrees."""
COLOR_STEP = 3
"""A colour has a name if it keeps the name when each channel differs by this much: a GLB stores it that well."""


def number_word(count: int) -> str:
    """Return a number in words up to twelve, and in digits beyond."""
    return NUMBERS[count] if 0 <= count < len(NUMBERS) else str(count)


def word_number(word: str) -> int:
    """Return the number of a word. Raises ValueError for another word."""
    if word in ("a", "an"):
        return 1
    return NUMBERS.index(word) if word in NUMBERS else int(word)


def article(noun: str) -> str:
    """Return a noun after its indefinite article."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def plural(noun: str) -> str:
    """Return the plural of a noun."""
    head, _, last = noun.rpartition(" ")
    before = f"{head} " if head else ""
    if last in IRREGULAR_PLURALS:
        return before + IRREGULAR_PLURALS[last]
    if re.search(r"[^aeiou]y$", last):
        return f"{before}{last[:-1]}ies"
    if _is_plural(last):
        return f"sets of {noun}"
    return before + last + ("es" if re.search(r"(s|x|z|ch|sh)$", last) else "s")


def singular(noun: str) -> str:
    """Return the phrase for one of a noun."""
    head, _, last = noun.rpartition(" ")
    if _is_plural(last) and last not in COUNTED_SINGULARS:
        return f"set of {noun}"
    return (f"{head} " if head else "") + COUNTED_SINGULARS.get(last, last)


def _is_plural(word: str) -> bool:
    """Return whether a label names several things, such as `planks`."""
    return word.endswith("s") and not word.endswith(("ss", "is", "us"))


def counted(count: int, noun: str) -> str:
    """Return a number of things in words, such as `two shelves` or `a shelf`."""
    return article(singular(noun)) if count == 1 else f"{number_word(count)} {plural(noun)}"


def label_nouns(labels: Sequence[str]) -> Mapping[str, str]:
    """Return a noun for each label, unique among them; labels whose words say nothing have none.

    Of a path of parts, such as `Chair/Base/back_leg`, it is the end; where two ends are equal, their last two names.
    """
    words = {label: [_words(step) for step in label.split("/")] for label in labels}
    nouns: dict[str, str] = {}
    for label, steps in words.items():
        alike = [other for other in words.values() if other[-1] == steps[-1]]
        used = [word for step in (steps[-1:] if len(alike) == 1 else steps[-2:]) for word in step]
        if used and all(word.isalpha() and word not in UNUSABLE_WORDS for word in used) and used[-1] not in PLACES:
            nouns[label] = " ".join(used)
    values = list(nouns.values())
    return {label: noun for label, noun in nouns.items() if values.count(noun) == 1}


def source_noun(kit: str, labels: Sequence[str], nouns: Mapping[str, str]) -> str:
    """Return what a shape of a source is called: as the config says, as the root of its paths, or as its source.

    labels: of the parts of the shape. A source whose name is a plural, such as `primitives`, has shapes.
    """
    if kit in nouns:
        return nouns[kit]
    roots = {label.partition("/")[0] for label in labels}
    words = _words(roots.pop() if len(roots) == 1 and all("/" in label for label in labels) else kit)
    return "shape" if not words or _is_plural(words[-1]) else " ".join(words)


def _words(name: str) -> list[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = [word.lower() for word in re.split(r"[\s_.\-]+", spaced) if word]
    if len(words) > 1 and words[-1] in PLACES and words[0] not in PLACES:
        words = [words[-1], *words[:-1]]
    return PLAIN_WORDS.get(" ".join(words), words)


def color_name(color: Sequence[int]) -> str:
    """Return the name of an sRGB colour, or nothing if it is near the border between two names."""
    steps = [(max(0, level - COLOR_STEP), level, min(255, level + COLOR_STEP)) for level in color]
    names = {plain_color_name(near) for near in product(*steps)}
    return names.pop() if len(names) == 1 else ""


def plain_color_name(color: Sequence[int]) -> str:
    """Return the name of an sRGB colour: by hue, saturation and value."""
    red, green, blue = (level / 255 for level in color)
    value, low = max(red, green, blue), min(red, green, blue)
    spread = value - low
    saturation = spread / value if value else 0.0
    if value < 0.16:
        return "black"
    if saturation < 0.12 or spread < 0.06:
        return "white" if value > 0.85 else "light grey" if value > 0.68 else "grey" if value > 0.35 else "dark grey"
    if value == red:
        hue = ((green - blue) / spread) % 6
    else:
        hue = (blue - red) / spread + 2 if value == green else (red - green) / spread + 4
    degrees = 60 * float(np.round(hue, 9))
    warm = 12 <= degrees < 50
    if warm and saturation < 0.3 and value > 0.75:
        return "beige"
    if warm and (value < 0.7 or saturation < 0.6):
        return "dark brown" if value < 0.4 else "brown" if value < 0.7 else "light brown"
    return next(name for limit, name in HUES if degrees < limit)
