"""A string VAE with random weights and the grammar mask of a kit: its strings are valid, and seldom equal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from pipeline.shards import json_bytes
from stages.shape.kit import Kit
from stages.strings.compiled_grammar import compile_grammar, patterns_json
from stages.strings.tokens import make_alphabet
from stages.training.checkpoint import checkpoint_bytes
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.training import new_model
from stages.training.string_vae.vocabulary import Vocabulary

MAX_TOKENS = 40


def publish_model(
    out: Path, dataset: str, kit: Kit, strings: Sequence[str], changed: Mapping[str, Any] | None = None
) -> Path:
    """Write a model called `tiny`, with a `changed` header, and the training strings of a dataset; return its path."""
    vocabulary = Vocabulary(make_alphabet(kit.labels), 1)
    sizes = {"latent": 4, "embedding": 4, "hidden": 16, "max_rounds": 1, "decoder": "masked", "cycle_attention": False}
    entry = StringVaeConfig.model_validate({"name": "tiny", "kind": "string_vae", **sizes})
    module = new_model(entry, vocabulary, MAX_TOKENS, 7)
    header = {
        "kind": "string_vae",
        "name": f"tiny-{kit.name}-0",
        "kit": kit.name,
        "settings": entry.model_dump(mode="json", exclude={"name", "kits", "seeds", "patience"}),
        "names": list(kit.labels),
        "cycles": vocabulary.cycles,
        "canonical": True,
        "max_tokens": MAX_TOKENS,
        "patterns": patterns_json(compile_grammar(kit.grammar, len(kit.labels), vocabulary.cycles)),
        **(changed or {}),
    }
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.mul_(3.0)
    path = out / f"{dataset}-models" / f"tiny-{kit.name}-0" / "weights.safetensors"
    corpus = out / f"{dataset}-corpus" / f"{kit.name}-train.txt"
    for file, content in (
        (path, checkpoint_bytes(module.state_dict(), header)),
        (corpus, "".join(f"{string}\n" for string in strings).encode()),
        (corpus.with_name("vocabulary.json"), json_bytes({kit.name: {"edges": "all"}})),
    ):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return path
