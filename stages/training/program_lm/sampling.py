"""Sample programs word by word, in batches, with the grammar's mask and backtracking.

A line that reaches out of its box is taken back.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import torch

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.program_lm.model import Cache, ProgramLm
from stages.training.program_lm.partial_program import PartialProgram
from stages.training.program_lm.tokens import NUMBER_FIELDS, TokenField
from stages.training.program_vae.lines import START

PROGRAMS_PER_BATCH = 64
LINE_TRIES = 4
"""Failures at one place before the line before is taken back too; then two lines, four and so on."""
MAX_LINE_TRIES = 32
"""Failures before a program is abandoned."""


@dataclass(frozen=True)
class SamplingOptions:
    """How words are sampled.

    temperature: divides the logits.
    top_p: total probability of the likeliest numbers to choose from. Other words are sampled from all that are allowed:
        improbable structure is variety, improbable numbers make shapes that fall over.
    """

    temperature: float
    top_p: float


@dataclass
class _Attempt:
    """A program that is being sampled.

    starts: index of the first word of each line.
    failures: lines taken back.
    recent_failures: those since the program last grew beyond `reached` words.
    """

    number: int
    program: PartialProgram
    words: list[int] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    failures: int = 0
    recent_failures: int = 0
    reached: int = 0

    def take(self, word: int) -> None:
        """Append a word, or backtrack where the line that it ends reaches out of the box."""
        if self.program.field == TokenField.COMMAND:
            self.starts.append(len(self.words))
        self.words.append(word)
        if not self.program.take(word, fit=True):
            self._backtrack()

    def _backtrack(self) -> None:
        if len(self.words) > self.reached:
            self.reached, self.recent_failures = len(self.words), 0
        self.failures, self.recent_failures = self.failures + 1, self.recent_failures + 1
        lines = min(2 ** (self.recent_failures // LINE_TRIES), len(self.starts))
        kept = self.words[: self.starts[-lines]]
        del self.starts[-lines:]
        self.words, self.program = [], PartialProgram(self.program.values, self.program.unit)
        for word in kept:
            self.words.append(word)
            self.program.take(word, fit=False)


@torch.no_grad()
def sample_programs(
    module: ProgramLm, unit: float, count: int, options: SamplingOptions, rng: np.random.Generator
) -> list[AssemblyProgram | None]:
    """Sample programs with numbers to three decimals, which keep every rule and whose cuboids stay within their boxes.

    unit: length that divides the sizes of a root.
    Returns None for a program with too many failures, with more words than any training program, or beyond the limits
    of execution.
    """
    values, longest = module.values.cpu().numpy(), module.places.num_embeddings
    programs: list[AssemblyProgram | None] = [None] * count
    attempts = [_Attempt(number, PartialProgram(values, unit)) for number in range(min(count, PROGRAMS_PER_BATCH))]
    started = len(attempts)
    cache = module.start(len(attempts))
    while attempts:
        _sample_step(module, attempts, cache, options, rng)
        open_ = []
        for row, attempt in enumerate(attempts):
            finished = attempt.program.field is None
            if not finished and len(attempt.words) < longest and attempt.failures < MAX_LINE_TRIES:
                open_.append(row)
                continue
            programs[attempt.number] = attempt.program.program() if finished else None
            if started < count:
                attempts[row] = _Attempt(started, PartialProgram(values, unit))
                started += 1
                open_.append(row)
        if len(open_) < len(attempts):
            attempts = [attempts[row] for row in open_]
            cache = [(keys[open_], values_[open_]) for keys, values_ in cache]
    return programs


def _sample_step(
    module: ProgramLm, attempts: list[_Attempt], cache: Cache, options: SamplingOptions, rng: np.random.Generator
) -> None:
    """Sample one word of each program."""
    before = torch.tensor([attempt.words[-1] if attempt.words else START for attempt in attempts])
    cues = torch.tensor([attempt.program.cue for attempt in attempts])
    sizes = torch.from_numpy(np.stack([attempt.program.size_inputs() for attempt in attempts])).float()
    places = torch.tensor([len(attempt.words) for attempt in attempts])
    logits = module.step(before, cues, sizes, places, cache).double().numpy()
    allowed = np.stack([attempt.program.allowed() for attempt in attempts])
    top_p = np.where(np.isin(cues[:, 0].numpy(), NUMBER_FIELDS), options.top_p, 1.0)
    words = sample_words(logits, allowed, options.temperature, top_p, rng)
    for attempt, word in zip(attempts, words.tolist(), strict=True):
        attempt.take(word)


def sample_words(
    logits: FloatArray, allowed: BoolArray, temperature: float, top_p: FloatArray, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Sample a word for each row, int64 (n,), among the likeliest allowed words with total probability `top_p`.

    logits: float64 (n, words).
    allowed: bool (n, words).
    top_p: float64 (n,).
    """
    scores = np.where(allowed, logits / temperature, -np.inf)
    shares = np.exp(scores - scores.max(axis=1, keepdims=True))
    order = np.argsort(-shares, axis=1, kind="stable")
    shares = np.take_along_axis(shares, order, axis=1)
    sums = np.cumsum(shares, axis=1)
    # The likeliest word is always among them.
    last = np.argmax(sums >= top_p[:, None] * sums[:, -1:], axis=1)
    uniform = rng.random(len(sums)) * np.take_along_axis(sums, last[:, None], axis=1)[:, 0]
    rank = np.argmax(sums > uniform[:, None], axis=1)
    words: npt.NDArray[np.int64] = np.take_along_axis(order, rank[:, None], axis=1)[:, 0]
    return words
