"""Small string VAEs of the toy kit, with random weights and trained ones."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import torch

from stages.strings.compiled_grammar import CompiledGrammar, compile_grammar, patterns_json
from stages.strings.grammar_mask import masks_along
from stages.training.loop import TrainState, train
from stages.training.string_vae.batches import StringCorpus
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.trained import TrainedStringVae
from stages.training.string_vae.training import StringVaeTask, new_model
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary
from tests.stages.training import toy_training

VOCABULARY = Vocabulary(toy_training.ALPHABET, 2)
MAX_TOKENS = 60
LEARNT_SHAPES = 5
"""Shapes whose strings `trained_vae` learns: a model that decodes one string for all returns at most a quarter."""


@cache
def rules() -> CompiledGrammar:
    return compile_grammar(toy_training.grammar(), 3, 2)


def entry(**changes: Any) -> StringVaeConfig:
    """Settings of a model that learns in seconds."""
    settings = {
        "name": "tiny",
        "latent": 8,
        "embedding": 8,
        "hidden": 64,
        "precision": "float32",
        "batch_size": 22,
        "steps": 80,
        "max_rounds": 1,
    }
    return StringVaeConfig.model_validate(
        {**settings, "anneal_steps": 50, "kl_weight": 0.01, "word_dropout": 0.1, **changes}
    )


@cache
def toy_strings(shapes: int | None = None) -> tuple[str, ...]:
    """The strings of the first shapes of the toy, or of all."""
    return tuple(string for strings in _strings_of_shapes()[:shapes] for string in strings)


@cache
def _strings_of_shapes() -> list[list[str]]:
    return [strings for shard in toy_training.SPLITS for _, strings in toy_training.strings(shard)]


def numbered(count: int | None = None) -> StringCorpus:
    """The strings of the first shapes as a learner takes them."""
    shapes = _strings_of_shapes()[:count]
    codes = [np.append(VOCABULARY.codes(string), np.int16(END_TOKEN)) for string in toy_strings(count)]
    masks = [masks_along(rules(), 2, code.astype(np.int64))[0] for code in codes]
    return StringCorpus(
        tokens=np.concatenate(codes),
        first=np.cumsum([0, *map(len, codes)]),
        masks=np.packbits(np.concatenate(masks), axis=-1, bitorder="little"),
        graph=np.repeat(np.arange(len(shapes), dtype=np.int32), [len(strings) for strings in shapes]),
        histograms=np.array(
            [np.bincount(VOCABULARY.codes(strings[0]), minlength=4)[1:4] for strings in shapes], dtype=np.int32
        ),
    )


def wrapped(module: torch.nn.Module, settings: StringVaeConfig) -> TrainedStringVae:
    header = {
        "settings": settings.model_dump(mode="json", exclude={"name", "kits", "seeds", "patience"}),
        "max_tokens": MAX_TOKENS,
        "patterns": patterns_json(rules()),
        "names": list(toy_training.LABELS),
        "cycles": 2,
        "canonical": True,
    }
    return TrainedStringVae(module.eval(), VOCABULARY, rules(), header)


def random_vae(decoder: str, seed: int = 0, cycle_attention: bool = True) -> TrainedStringVae:
    """A model with random weights, which are larger than fresh ones, so that it has preferences."""
    settings = entry(decoder=decoder, cycle_attention=cycle_attention)
    module = new_model(settings, VOCABULARY, MAX_TOKENS, seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.mul_(3.0)
    return wrapped(module, settings)


@cache
def trained_vae(decoder: str) -> TrainedStringVae:
    """A model that has learnt the strings of the first shapes of the toy."""
    settings = entry(decoder=decoder, learning_rate=0.01)
    strings = numbered(LEARNT_SHAPES)
    learner = StringVaeTask(
        new_model(settings, VOCABULARY, MAX_TOKENS, 1), {}, settings, strings, strings, VOCABULARY, True
    )
    train(TrainState.of(learner), np.random.default_rng(2), lambda done, total: None)
    return wrapped(learner.module, settings)
