"""Prepare the strings of a kit as token numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.shards import read_shard
from pipeline.stage import Outcome, Task
from stages.shape.kit_input import input_kit
from stages.strings.compiled_grammar import CompiledGrammar, compile_grammar, patterns_json
from stages.strings.settings import StringsConfig
from stages.strings.tokens import make_alphabet, number_value, split_tokens
from stages.training.corpus import write_arrays, write_description
from stages.training.string_vae.batches import StringCorpus
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary

Masks = npt.NDArray[np.bool_]


def prepare(task: Task) -> Outcome:
    """Write `.<split>.safetensors`, the `StringCorpus` of each split, and `.json`, their description.

    The strings of train define the cycle numbers. Rejects strings of other splits with more cycles, strings of more
    than `max_length` tokens, strings that train has too, and all strings of a shape whose first, canonical one is
    rejected. Raises Rejected where train or val keeps no string.
    """
    name, splits, max_length = task.shard.params["kit"], task.shard.params["splits"], task.shard.params["max_length"]
    kit = input_kit(task, name)
    alphabet = make_alphabet(kit.labels)
    shapes: dict[str, list[list[str]]] = {}
    for done, (shard, split) in enumerate(splits.items()):
        for key, strings in _strings_of(task, name, shard):
            kept = [string for string in strings if len(split_tokens(string)) <= max_length]
            kept = kept if strings[0] in kept[:1] else []  # the target of the others
            refused = len(strings) - len(kept)
            if refused:
                task.reject(key, "longer than training.max_length", count=refused)
            shapes.setdefault(split, []).append(kept)
        task.progress(done + 1, len(splits))
    vocabulary = Vocabulary(alphabet, _cycles(shapes.get("train", [])))
    edges = task.config.section(StringsConfig).edges
    rules = compile_grammar(kit.grammar, len(kit.labels), vocabulary.cycles, edges != "all")
    train_strings = {string for strings in shapes.get("train", []) for string in strings}
    counts, max_tokens = {}, 0
    for split, of_split in sorted(shapes.items()):
        corpus, needed_tokens = _numbered(
            task, vocabulary, rules, of_split, set() if split == "train" else train_strings
        )
        max_tokens = max(max_tokens, needed_tokens, int(corpus.lengths.max(initial=1)) - 1)
        counts[split] = {"strings": len(corpus), "graphs": len(corpus.histograms), "tokens": len(corpus.tokens)}
        write_arrays(task, f"{task.shard.name}.{split}.safetensors", corpus.arrays())
    for split in ("train", "val"):
        if not counts.get(split, {}).get("strings"):
            raise Rejected(f"kit {name} has no strings of at most {max_length} tokens in split {split}")
    description = {
        "kit": name,
        "names": list(alphabet.names),
        "edges": edges,
        "cycles": vocabulary.cycles,
        "max_tokens": max_tokens,
        "patterns": patterns_json(rules),
        "counts": counts,
    }
    write_description(task, description)
    return Outcome(samples=0, summary=counts)


def vocabulary_of(description: Mapping[str, Any]) -> Vocabulary:
    """Return the vocabulary that a description or header states."""
    return Vocabulary(make_alphabet(description["names"]), description["cycles"])


def _strings_of(task: Task, kit: str, shard: str) -> Iterator[tuple[str, list[str]]]:
    """Yield key and strings of each shape of a kit in a shard of stage `strings`."""
    with open(task.input("strings", f"{shard}.jsonl"), "rb") as lines:
        kits = {row["key"]: row["kit"] for row in map(json.loads, lines)}
    for key, members in read_shard(task.input("strings", f"{shard}.tar")):
        if kits[key] == kit:
            yield key, members["txt"].decode().splitlines()


def _cycles(shapes: list[list[str]]) -> int:
    """Return the number of cycle numbers."""
    numbers = {number_value(text) for strings in shapes for string in strings for text in split_tokens(string)}
    return 1 + max((number for number in numbers if number is not None), default=-1)


def _followed(rules: CompiledGrammar, vocabulary: Vocabulary, codes: npt.NDArray[np.int16]) -> tuple[Masks, int] | None:
    """Return `follow` of a string without its end; None where the rules do not admit it."""
    from stages.strings.grammar_mask import masks_along

    try:
        return masks_along(rules, vocabulary.cycles, np.append(codes, END_TOKEN).astype(np.int64))
    except ValueError:
        return None


def _numbered(
    task: Task, vocabulary: Vocabulary, rules: CompiledGrammar, shapes: list[list[str]], elsewhere: set[str]
) -> tuple[StringCorpus, int]:
    """Return the strings that are not `elsewhere`, and the most tokens that any of their prefixes needs."""
    types = len(vocabulary.alphabet.tokens)
    codes: list[npt.NDArray[np.int16]] = [np.empty(0, np.int16)]
    masks: list[npt.NDArray[np.uint8]] = [np.empty((0, -(-len(vocabulary) // 8)), np.uint8)]
    graph: list[int] = []
    histograms: list[npt.NDArray[np.int64]] = []
    max_tokens = 0
    for strings in shapes:
        before = len(graph)
        for index, string in enumerate(strings):
            if index and len(graph) == before:
                task.reject(string, "its canonical string was refused", count=len(strings) - index)
                break
            if string in elsewhere:
                task.reject(string, "occurs in train too")
                continue
            if not _knows(vocabulary, string):
                task.reject(string, "cycle numbers that train lacks")
                continue
            numbers = vocabulary.codes(string)
            followed = _followed(rules, vocabulary, numbers)
            if followed is None:
                task.reject(string, "not admitted by the grammar")
                continue
            masks.append(np.packbits(followed[0], axis=-1, bitorder="little"))
            codes.append(np.append(numbers, np.int16(END_TOKEN)))
            graph.append(len(histograms))
            max_tokens = max(max_tokens, followed[1])
        if len(graph) > before:
            histograms.append(np.bincount(codes[-1], minlength=types + 1)[1 : types + 1])
    return StringCorpus(
        tokens=np.concatenate(codes),
        first=np.cumsum([len(string) for string in codes], dtype=np.int64),
        masks=np.concatenate(masks),
        graph=np.array(graph, dtype=np.int32),
        histograms=np.array(histograms, dtype=np.int32).reshape(-1, types),
    ), max_tokens


def _knows(vocabulary: Vocabulary, string: str) -> bool:
    numbers = map(number_value, split_tokens(string))
    return all(number is None or number < vocabulary.cycles for number in numbers)
