"""The strings of a kit, made ready: read once from the shards of stage `strings`, as numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes, read_shard
from pipeline.stage import Outcome, Task
from stages.shape.kit_input import input_kit
from stages.strings.alphabet import make_alphabet
from stages.strings.tokens import number_value, split_tokens
from stages.training.string_vae.batches import Strings
from stages.training.string_vae.vocabulary import END, Vocabulary

__all__ = ["prepare_corpus", "read_corpus"]


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `Strings` of each split; `.json`, what the tokens stand for.

    The strings of train say which cycle numbers there are; strings of other splits with more, and strings of more than
    `longest` tokens, are refused. Raises Rejected where train or val keeps none.
    """
    kit, splits, longest = task.shard.params["kit"], task.shard.params["splits"], task.shard.params["longest"]
    alphabet = make_alphabet(input_kit(task, kit).labels)
    shapes: dict[str, list[list[str]]] = {}
    for done, (shard, split) in enumerate(splits.items()):
        for key, strings in _strings_of(task, kit, shard):
            kept = [each for each in strings if len(split_tokens(each)) <= longest]
            refused = len(strings) - len(kept)
            if refused:
                task.reject(key, "longer than training.longest", count=refused)
            shapes.setdefault(split, []).append(kept)
        task.progress(done + 1, len(splits))
    vocabulary = Vocabulary(alphabet, _cycles(shapes.get("train", [])))
    counts = {}
    for split, of_split in sorted(shapes.items()):
        strings = _numbered(task, vocabulary, of_split)
        counts[split] = {"strings": len(strings), "graphs": len(strings.histograms), "tokens": len(strings.tokens)}
        _write(task, f"{task.shard.name}.{split}.safetensors", strings)
    for split in ("train", "val"):
        if not counts.get(split, {}).get("strings"):
            raise Rejected(f"kit {kit} has no strings of at most {longest} tokens in split {split}")
    described = {
        "kit": kit,
        "names": list(alphabet.names),
        "cycles": vocabulary.cycles,
        "longest": max(len(split_tokens(each)) for of in shapes.values() for strings in of for each in strings),
        "counts": counts,
    }
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json_bytes(described))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], Vocabulary, dict[str, Strings]]:
    """What `prepare_corpus` wrote in shard `data`: a description, the vocabulary, the strings of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    vocabulary = Vocabulary(make_alphabet(described["names"]), described["cycles"])
    paths: Mapping[str, Path] = {
        split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")
    }
    return described, vocabulary, {split: Strings.of(load_file(path)) for split, path in paths.items()}


def _strings_of(task: Task, kit: str, shard: str) -> Iterator[tuple[str, list[str]]]:
    """The key and the strings of each shape of a kit in a shard of stage `strings`."""
    with open(task.input("strings", f"{shard}.jsonl"), "rb") as lines:
        kits = {row["key"]: row["kit"] for row in map(json.loads, lines)}
    for key, members in read_shard(task.input("strings", f"{shard}.tar")):
        if kits[key] == kit:
            yield key, members["txt"].decode().splitlines()


def _cycles(shapes: list[list[str]]) -> int:
    """One more than the greatest cycle number."""
    numbers = {number_value(text) for strings in shapes for each in strings for text in split_tokens(each)}
    return 1 + max((number for number in numbers if number is not None), default=-1)


def _numbered(task: Task, vocabulary: Vocabulary, shapes: list[list[str]]) -> Strings:
    codes, graph, histograms = [], [], []
    types = len(vocabulary.alphabet.tokens)
    for strings in shapes:
        known = [vocabulary.codes(each) for each in strings if _knows(vocabulary, each)]
        if len(known) < len(strings):
            task.reject(strings[0], "cycle numbers that train has not", count=len(strings) - len(known))
        if known:
            graph += [len(histograms)] * len(known)
            histograms.append(np.bincount(known[0], minlength=types + 1)[1 : types + 1])
            codes += [np.append(each, END) for each in known]
    lengths = np.array([len(each) for each in codes], dtype=np.int64)
    return Strings(
        tokens=np.concatenate([np.empty(0, np.int16), *codes]).astype(np.int16),
        first=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        masks=np.full((int(lengths.sum()), -(-len(vocabulary) // 8)), 255, dtype=np.uint8),
        graph=np.array(graph, dtype=np.int32),
        histograms=np.array(histograms, dtype=np.int32).reshape(-1, types),
    )


def _knows(vocabulary: Vocabulary, string: str) -> bool:
    numbers = map(number_value, split_tokens(string))
    return all(number is None or number < vocabulary.cycles for number in numbers)


def _write(task: Task, file: str, strings: Strings) -> None:
    from safetensors.numpy import save

    with task.output(file) as stream:
        stream.write(save(strings.arrays()))
