"""The grammar of captions: sentences for facts, and the way back from sentences to facts.

A slot `{index:code}` of a sentence stands for an argument of the fact: `n` a number in words, `p` a noun in the plural,
`s` a noun in the singular, `w` a word as it is, `d` digits, `t` a number of times.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from stages.captions.facts import Fact
from stages.captions.words import NUMBERS, article, counted, number_word, plural, singular, word_number

TIMES = {
    "1.5": "one and a half times",
    "2": "twice",
    "2.5": "two and a half times",
    **{str(number): f"{NUMBERS[number]} times" for number in range(3, 9)},
}
_SLOT = re.compile(r"\{(\d):(\w)\}")


@dataclass(frozen=True)
class Sentence:
    """One way to state facts of a kind.

    fixed: arguments that it states without a slot, by index
    many: arguments that must be more than 1, by index
    """

    kind: str
    text: str
    fixed: Mapping[int, str] = field(default_factory=dict)
    many: tuple[int, ...] = ()

    def states(self, fact: Fact) -> bool:
        """Return whether the sentence can state a fact."""
        return (
            fact.kind == self.kind
            and all(fact.about[index] == value for index, value in self.fixed.items())
            and all(int(fact.about[index]) > 1 for index in self.many)
        )


SENTENCES = (
    Sentence("parts", "It is made of {0:n} parts.", many=(0,)),
    Sentence("parts", "It consists of {0:n} parts.", many=(0,)),
    Sentence("parts", "It is one piece.", {0: "1"}),
    Sentence("longer", "It is taller than it is {1:w}.", {0: "tall"}),
    Sentence("longer", "It is wider than it is tall.", {0: "wide", 1: "tall"}),
    Sentence("longer", "It is longer than it is tall.", {0: "long", 1: "tall"}),
    Sentence("equal", "It is about as tall as it is {0:w}."),
    Sentence("equal", "It is about as {0:w} as it is tall."),
    Sentence("ratio", "It is about {2:t} as {0:w} as it is {1:w}."),
    Sentence("height", "It is {0:d} m tall."),
    Sentence("height", "Its height is {0:d} m."),
    Sentence("grid", "Its {0:n} {1:p} form {2:n} columns of {3:n}."),
    Sentence("grid", "The {0:n} {1:p} are arranged in {2:n} columns of {3:n}."),
    Sentence("stack", "The {0:n} {1:p} are one above the other."),
    Sentence("row", "The {0:n} {1:p} are in a row, at equal distances."),
    Sentence("row", "The {0:n} {1:p} form a straight row."),
    Sentence("circle", "The {0:n} {1:p} form a circle."),
    Sentence("stands on", "It stands on its {1:s}.", {0: "1"}),
    Sentence("stands on", "It stands on its {0:n} {1:p}.", many=(0,)),
    Sentence("stands on", "It rests on {0:n} {1:p}.", many=(0,)),
    Sentence("above", "The {1:s} is above the {3:s}.", {0: "1", 2: "1"}),
    Sentence("above", "The {1:s} is above the {2:n} {3:p}.", {0: "1"}, (2,)),
    Sentence("above", "The {0:n} {1:p} are above the {3:s}.", {2: "1"}, (0,)),
    Sentence("above", "The {0:n} {1:p} are above the {2:n} {3:p}.", many=(0, 2)),
    Sentence("touches", "Every {0:s} touches the {2:s}.", {1: "1"}),
    Sentence("touches", "Every {0:s} touches at least one of the {1:n} {2:p}.", many=(1,)),
    Sentence("color", "The {1:s} is {2:w}.", {0: "1"}),
    Sentence("color", "The {0:n} {1:p} are {2:w}.", many=(0,)),
    Sentence("all color", "All of it is {0:w}."),
    Sentence("all color", "It is {0:w} all over."),
    Sentence("stable", "It stands by itself."),
    Sentence("unstable", "It does not stand by itself."),
    Sentence("not rooted", "Not all of its parts are connected to the ground."),
    Sentence("tilt", "It stays upright on ground that slopes by {0:d} degrees."),
    Sentence("tilt", "It does not tip over when it is tilted by {0:d} degrees."),
    Sentence("mirror", "It is symmetric about an upright plane."),
)
OPENINGS = ("{head} with {things}.", "{head} that has {things}.")


def sentence(fact: Fact, rng: np.random.Generator) -> str:
    """Return a sentence that states a fact, one of several by `rng`. Raises ValueError if no sentence can."""
    ways = [way for way in SENTENCES if way.states(fact)]
    if not ways:
        raise ValueError(f"no sentence states {fact}")
    way = ways[int(rng.integers(len(ways)))]
    return _SLOT.sub(lambda match: _filled(match[2], fact.about[int(match[1])]), way.text)


def opening(noun: str, adjective: str, things: Sequence[Fact], rng: np.random.Generator) -> str:
    """Return the first sentence: what the shape is, and some of what it has.

    things: facts `count`, or `grid` for parts in columns
    """
    head = article(f"{adjective} {noun}".strip())
    head = head[0].upper() + head[1:]
    if not things:
        return f"{head}."
    listed = [_thing(fact) for fact in things]
    text = listed[0] if len(listed) == 1 else f"{', '.join(listed[:-1])} and {listed[-1]}"
    return OPENINGS[int(rng.integers(len(OPENINGS)))].format(head=head, things=text)


def _thing(fact: Fact) -> str:
    if fact.kind == "count":
        return counted(int(fact.about[0]), fact.about[1])
    count, noun, columns, rows = fact.about
    return f"{counted(int(count), noun)} in {number_word(int(columns))} columns of {number_word(int(rows))}"


def _filled(code: str, value: str) -> str:
    return {
        "n": lambda: number_word(int(value)),
        "p": lambda: plural(value),
        "s": lambda: singular(value),
        "t": lambda: TIMES[value],
    }.get(code, lambda: value)()


class CaptionParser:
    """Reads captions back, for the nouns of one source.

    noun: what a shape is called
    nouns: nouns of its labels
    """

    def __init__(self, noun: str, nouns: Sequence[str]) -> None:
        self._noun = noun
        self._plurals = {plural(name): name for name in nouns}
        self._singulars = {singular(name): name for name in nouns}
        words = "|".join((*NUMBERS, r"\d+"))
        names = {"n": words, "p": _any(self._plurals), "s": _any(self._singulars)}
        self._codes = {**names, "w": "[a-z ]+", "d": r"\d+(?:\.\d+)?", "t": _any(TIMES.values())}
        self._patterns = [(way, *self._pattern(way.text)) for way in SENTENCES]
        one, several = _any(map(article, self._singulars)), f"(?:{words}) {self._codes['p']}"
        self._thing = re.compile(rf"({one}|{several})(?: in ({words}) columns of ({words}))?")

    def facts(self, caption: str) -> list[Fact]:
        """Return all that a caption states. Raises ValueError for a sentence that is not of the grammar."""
        first, *others = re.findall(r"[^.]*(?:\.\d[^.]*)*\.", caption)
        found = [*self._opening(first), *(self._fact(text.strip()) for text in others)]
        if " ".join([first, *(text.strip() for text in others)]) != caption:
            raise ValueError(f"{caption!r} does not consist of sentences")
        return found

    def _opening(self, text: str) -> Iterator[Fact]:
        match = re.fullmatch(rf"An? (?:(tall|low) )?{re.escape(self._noun)}(?: (?:with|that has) (.*))?\.", text)
        if match is None:
            raise ValueError(f"{text!r} does not say what the shape is")
        yield Fact("noun", (self._noun,))
        if match[1]:
            yield Fact("adjective", (match[1],))
        rest = match[2] or ""
        while rest:
            thing = self._thing.match(rest)
            if thing is None:
                raise ValueError(f"{text!r} has {rest!r}, which is no list of parts")
            yield self._counted(thing)
            rest = rest[thing.end() :]
            rest = re.sub(r"^(?:, | and )", "", rest) if rest else rest

    def _counted(self, match: re.Match[str]) -> Fact:
        number, _, name = match[1].partition(" ")
        noun = self._singulars[name] if number in ("a", "an") else self._plurals[name]
        count = str(word_number(number))
        if match[2]:
            return Fact("grid", (count, noun, str(word_number(match[2])), str(word_number(match[3]))))
        return Fact("count", (count, noun))

    def _pattern(self, text: str) -> tuple[re.Pattern[str], list[tuple[int, str]]]:
        slots = [(int(index), code) for index, code in _SLOT.findall(text)]
        pieces = [re.escape(piece) for piece in _SLOT.split(text)[::3]]
        groups = [f"({self._codes[code]})" for _, code in slots]
        return re.compile("".join(a + b for a, b in zip(pieces, [*groups, ""], strict=True))), slots

    def _fact(self, text: str) -> Fact:
        for way, pattern, slots in self._patterns:
            match = pattern.fullmatch(text)
            if match is None:
                continue
            about = dict(way.fixed)
            for (index, code), value in zip(slots, match.groups(), strict=True):
                about[index] = self._argument(code, value)
            return Fact(way.kind, tuple(about[index] for index in sorted(about)))
        raise ValueError(f"{text!r} is no sentence of the grammar")

    def _argument(self, code: str, value: str) -> str:
        if code == "n":
            return str(word_number(value))
        if code == "t":
            return next(number for number, words in TIMES.items() if words == value)
        return {"p": self._plurals, "s": self._singulars}.get(code, {}).get(value, value)


def _any(words: Iterable[str]) -> str:
    listed = sorted((re.escape(word) for word in words), key=len, reverse=True)
    return f"(?:{'|'.join(listed)})" if listed else "(?!)"
