"""Strings and programs that train a VAE per second and core.

The peer of strings is trained as in MOSES, with the same sizes and strings: random batches of all lengths, sorted by
length, encoded and decoded as packed sequences, without a mask. The peer of programs is our own model with batches of
one program, as in shapeassembly §6.2; the assemblies of a level are still batched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count, cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy
from torch.nn.utils.rnn import pack_sequence, pad_packed_sequence

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shapeassembly import parse
from stages.shapeassembly.syntax.errors import ProgramError
from stages.strings.compiled_grammar import compile_grammar
from stages.strings.grammar_mask import masks_along
from stages.strings.kit_strings import KitStrings
from stages.training.loop import MAX_GRADIENT_NORM, set_deterministic
from stages.training.program_vae.batches import ProgramCorpus
from stages.training.program_vae.lines import assembly_lines
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.training import ProgramVaeTask
from stages.training.program_vae.training import new_model as new_program_vae
from stages.training.string_vae.batches import StringCorpus
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.training import StringVaeTask, new_model
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.bench.bench_shapeassembly import category_texts
from tests.bench.measure import Measure, rate

VARIANT_COUNT = 60


def bench() -> Iterator[Measure]:
    """Strings of the shipped castle: forward, backward and one step of Adam."""
    set_deterministic(1)
    strings, vocabulary, most = castle_strings()
    note = f"{int(np.median(strings.lengths))} tokens (median)"
    entry = StringVaeConfig(name="bench")
    peer = rate(moses_steps(strings, len(vocabulary), entry), 4.0, 2)
    arms: dict[str, dict[str, Any]] = {
        "plain": {"decoder": "plain"},
        "masked": {"precision": "float32"},
        "masked, bfloat16": {"precision": "bfloat16"},
        "transformer": {"decoder": "transformer", "hidden": 128, "layers": 3},
    }
    for name, settings in arms.items():
        arm = StringVaeConfig.model_validate({"name": "bench", **settings})
        learner = StringVaeTask(new_model(arm, vocabulary, most, 0), {}, arm, strings, strings, vocabulary, True)
        ours = rate(string_vae_steps(learner), 4.0, 2)
        yield Measure(f"string VAE learns, {name}", "strings", ours, "as in MOSES", peer, note)
    yield _programs_measure()


def _programs_measure() -> Measure:
    """Forward, backward and a step of Adam on the programs of a category."""
    assemblies = []
    for text in next(iter(category_texts().values())):
        with suppress(ProgramError):
            assemblies.append(assembly_lines(parse(text)))
    rates = {}
    for batch in (64, 1):
        entry = ProgramVaeConfig(name="bench", kind="program_vae", batch_size=batch)
        programs = ProgramCorpus.of(list(islice(cycle(assemblies), max(len(assemblies), batch))))
        learner = ProgramVaeTask(new_program_vae(entry, 0), {}, entry, programs, programs)
        rates[batch] = rate(_steps(learner, lambda levels: len(levels[0].lines)), 4.0, 2)
    note = "batches of 64, levels of one batched in both"
    return Measure("program VAE learns", "programs", rates[64], "one program at a time", rates[1], note)


def castle_strings() -> tuple[StringCorpus, Vocabulary, int]:
    """Return nine strings per variant, of VARIANT_COUNT variants."""
    shapes = tuple(ShapeFile(path=path) for path in sorted(Path("datasets/exemplars/castle").glob("*.glb")))
    kit = read_kit(KitConfig(name="castle", shapes=shapes).resolve(STRICTEST))
    rng = np.random.default_rng(0)
    found, _ = Search(ContactOracle(kit), SearchConfig()).run(rng, VARIANT_COUNT, 10**9, "bench", lambda count: None)
    writer = KitStrings(kit, "all")
    written = [[encoded.string for encoded in writer.strings(writer.graph(new.assembly), 8, rng)] for new in found]
    cycles = 12
    vocabulary, grammar = Vocabulary(writer.alphabet, cycles), compile_grammar(kit.grammar, len(kit.labels), cycles)
    codes = [
        np.append(vocabulary.codes(string), END_TOKEN).astype(np.int64) for of_shape in written for string in of_shape
    ]
    masks = [np.packbits(masks_along(grammar, cycles, tokens)[0], axis=-1, bitorder="little") for tokens in codes]
    types = len(kit.labels)
    strings = StringCorpus(
        tokens=np.concatenate(codes).astype(np.int16),
        first=np.cumsum([0, *map(len, codes)]),
        masks=np.concatenate(masks),
        graph=np.arange(len(codes), dtype=np.int32),
        histograms=np.stack([np.bincount(tokens, minlength=types + 1)[1 : types + 1] for tokens in codes]).astype(
            np.int32
        ),
    )
    return strings, vocabulary, max(map(len, codes))


def string_vae_steps(learner: StringVaeTask) -> Any:
    """Return a function that trains one step and returns its count of strings."""
    return _steps(learner, lambda batch: len(batch.codes))


def _steps(learner: Any, seen: Callable[[Any], int]) -> Any:
    """Return a function that trains one step and returns the size of its batch."""
    optimizer = torch.optim.Adam(learner.module.parameters())
    stream, noise, steps = learner.batches(np.random.default_rng(0)), torch.Generator().manual_seed(0), count()

    def step() -> int:
        batch = next(stream)
        with torch.autocast("cpu", torch.bfloat16, enabled=learner.config.precision == "bfloat16"):
            loss = learner.losses(batch, next(steps), noise)["loss"]
        _descend(learner.module, optimizer, loss)
        return seen(batch)

    return step


def moses_steps(strings: StringCorpus, tokens: int, entry: StringVaeConfig) -> Any:
    """Return the same function for the peer."""
    model = _Moses(entry, tokens)
    optimizer = torch.optim.Adam(model.parameters())
    rng = np.random.default_rng(0)
    tokens_of = [torch.from_numpy(part.astype(np.int64)) for part in np.split(strings.tokens, strings.first[1:-1])]

    def step() -> int:
        chosen = sorted((tokens_of[row] for row in rng.choice(len(tokens_of), entry.batch_size)), key=len, reverse=True)
        _descend(model, optimizer, model(chosen, entry.kl_weight))
        return len(chosen)

    return step


def _descend(module: nn.Module, optimizer: torch.optim.Adam, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(module.parameters(), MAX_GRADIENT_NORM)
    optimizer.step()


class _Moses(nn.Module):
    def __init__(self, entry: StringVaeConfig, tokens: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(tokens, entry.embedding)
        self.encoder = nn.GRU(entry.embedding, entry.hidden // 2, batch_first=True, bidirectional=True)
        self.mean, self.log_variance = nn.Linear(entry.hidden, entry.latent), nn.Linear(entry.hidden, entry.latent)
        self.first = nn.Linear(entry.latent, entry.hidden)
        self.decoder = nn.GRU(entry.embedding + entry.latent, entry.hidden, batch_first=True)
        self.logits = nn.Linear(entry.hidden, tokens)

    def forward(self, strings: list[Tensor], weight: float) -> Tensor:
        _, last = self.encoder(pack_sequence([self.embedding(tokens) for tokens in strings]))
        summary = torch.cat([last[0], last[1]], dim=-1)
        mean, log_variance = self.mean(summary), self.log_variance(summary)
        points = mean + torch.exp(0.5 * log_variance) * torch.randn_like(mean)
        shown = [torch.cat([tokens.new_full((1,), END_TOKEN), tokens[:-1]]) for tokens in strings]
        seen = [
            torch.cat([self.embedding(tokens), point.expand(len(tokens), -1)], dim=-1)
            for tokens, point in zip(shown, points, strict=True)
        ]
        written, _ = pad_packed_sequence(self.decoder(pack_sequence(seen), self.first(points)[None])[0], True)
        wanted = nn.utils.rnn.pad_sequence(strings, batch_first=True, padding_value=-1)
        nats = cross_entropy(self.logits(written).flatten(0, 1), wanted.flatten(), ignore_index=-1, reduction="sum")
        divergence = 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum(dim=-1).mean()
        loss: Tensor = nats / len(strings) + weight * divergence
        return loss
