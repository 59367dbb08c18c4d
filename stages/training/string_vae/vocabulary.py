"""The tokens of a string VAE, by number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from stages.strings.tokens import Alphabet, StringError, number_text, number_value, split_tokens

END_TOKEN = 0
"""The token that ends a string, and that precedes its first token."""


@dataclass(frozen=True)
class Vocabulary:
    """Token 0 ends a string; then come the types of `alphabet`, `(`, `)`, and the numbers below `cycles`."""

    alphabet: Alphabet
    cycles: int

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """The text of each token; that of the end is empty."""
        return ("", *self.alphabet.tokens, "(", ")", *map(number_text, range(self.cycles)))

    @cached_property
    def _codes(self) -> dict[str, int]:
        return {text: code for code, text in enumerate(self.texts)}

    def __len__(self) -> int:
        return len(self.texts)

    def codes(self, string: str) -> npt.NDArray[np.int16]:
        """Return the tokens of a string, int16 (n,), without an end. Raises StringError for an unknown token."""
        codes = []
        index = 0
        for text in split_tokens(string):
            number = number_value(text)
            code = self._codes.get(text if number is None else number_text(number))
            if code is None:
                raise StringError(string, index, f"token {text!r} is not in the vocabulary")
            codes.append(code)
            index += len(text)
        return np.array(codes, dtype=np.int16)

    def string(self, codes: Sequence[int] | npt.NDArray[np.integer]) -> str:
        """Return the string of some tokens, up to the first end."""
        texts = []
        for code in codes:
            if code == END_TOKEN:
                break
            texts.append(self.texts[code])
        return "".join(texts)
