"""Writes programs word by word, side by side: only words that the grammar allows, and lines that reach out of their box
are taken back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import torch

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.partial_program import PartialProgram
from stages.training.program_lm.tokens import NUMBER_FIELDS, TokenField
from stages.training.program_vae.lines import START

PROGRAMS_PER_BATCH = 64
"""Programs that are written side by side."""
LINE_TRIES = 4
"""Lines that are tried at a place before the one before it is taken back, too; then two, four and so on."""
MAX_LINE_TRIES = 32
"""Lines that are taken back before a program is given up."""


@dataclass(frozen=True)
class SamplingOptions:
    """How words are drawn: the logits divided by `temperature`; numbers among the likeliest that have a share of
    `top_p` together, all else among whatever is allowed: what is improbable there is variety, in numbers it falls
    over."""

    temperature: float
    top_p: float


@dataclass
class _Page:
    """A program on its way. starts: where its lines begin; tries: lines that were taken back, and how many of them
    since it has last grown beyond `reached`."""

    number: int
    text: PartialProgram
    words: list[int] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    tries: int = 0
    here: int = 0
    reached: int = 0

    def take(self, word: int) -> None:
        """Write a word, or, where the line that it ends reaches out of the box, go back."""
        if self.text.field == TokenField.COMMAND:
            self.starts.append(len(self.words))
        self.words.append(word)
        if not self.text.take(word, fit=True):
            self._go_back()

    def _go_back(self) -> None:
        if len(self.words) > self.reached:
            self.reached, self.here = len(self.words), 0
        self.tries, self.here = self.tries + 1, self.here + 1
        lines = min(2 ** (self.here // LINE_TRIES), len(self.starts))
        kept = self.words[: self.starts[-lines]]
        del self.starts[-lines:]
        self.words, self.text = [], PartialProgram(self.text.values, self.text.unit)
        for word in kept:
            self.words.append(word)
            self.text.take(word, fit=False)


@torch.no_grad()
def sample_programs(
    module: ProgramLm, unit: float, count: int, drawing: SamplingOptions, rng: np.random.Generator
) -> list[AssemblyProgram | None]:
    """So many programs, their numbers to three decimals; each keeps every rule of the language, and its cuboids stay
    within their boxes.

    None where too many lines were taken back, there are more words than in any program that the model has learnt, or
    the program is beyond the limits of execution. unit: the length that the sizes of a root are shares of.
    """
    values, longest = module.values.cpu().numpy(), module.places.num_embeddings
    found: list[AssemblyProgram | None] = [None] * count
    pages = [_Page(number, PartialProgram(values, unit)) for number in range(min(count, PROGRAMS_PER_BATCH))]
    begun = len(pages)
    cache = module.start(len(pages))
    while pages:
        _write_words(module, pages, cache, drawing, rng)
        open_ = []
        for row, page in enumerate(pages):
            if page.text.field is not None and len(page.words) < longest and page.tries < MAX_LINE_TRIES:
                open_.append(row)
                continue
            found[page.number] = page.text.program() if page.text.field is None else None
            if begun < count:
                pages[row] = _Page(begun, PartialProgram(values, unit))
                begun += 1
                open_.append(row)
        if len(open_) < len(pages):
            pages = [pages[row] for row in open_]
            cache = [(keys[open_], values_[open_]) for keys, values_ in cache]
    return found


def _write_words(
    module: ProgramLm,
    pages: list[_Page],
    cache: list[tuple[torch.Tensor, torch.Tensor]],
    drawing: SamplingOptions,
    rng: np.random.Generator,
) -> None:
    """One word more on each page."""
    before = torch.tensor([page.words[-1] if page.words else START for page in pages])
    cues = torch.tensor([page.text.cue for page in pages])
    seen = torch.from_numpy(np.stack([page.text.seen() for page in pages])).float()
    places = torch.tensor([len(page.words) for page in pages])
    logits = module.step(before, cues, seen, places, cache).double().numpy()
    allowed = np.stack([page.text.allowed() for page in pages])
    top_p = np.where(np.isin(cues[:, 0].numpy(), NUMBER_FIELDS), drawing.top_p, 1.0)
    for page, word in zip(pages, sample_words(logits, allowed, drawing.temperature, top_p, rng).tolist(), strict=True):
        page.take(word)


def sample_words(
    logits: FloatArray, allowed: BoolArray, temperature: float, top_p: FloatArray, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """A word for each row of logits (n, words), among those allowed, bool (n, words), that have its share of top_p
    (n,) together; int64 (n,)."""
    scores = np.where(allowed, logits / temperature, -np.inf)
    shares = np.exp(scores - scores.max(axis=1, keepdims=True))
    order = np.argsort(-shares, axis=1, kind="stable")
    shares = np.take_along_axis(shares, order, axis=1)
    sums = np.cumsum(shares, axis=1)
    # The likeliest word counts whatever its share is.
    last = np.argmax(sums >= top_p[:, None] * sums[:, -1:], axis=1)
    asked = rng.random(len(sums)) * np.take_along_axis(sums, last[:, None], axis=1)[:, 0]
    place = np.argmax(sums > asked[:, None], axis=1)
    found: npt.NDArray[np.int64] = np.take_along_axis(order, place[:, None], axis=1)[:, 0]
    return found
