"""The strings of a kit, made ready: read once from the shards of stage `strings`, as numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.shards import json_bytes, read_shard
from pipeline.stage import Outcome, Task
from stages.shape.kit_input import input_kit
from stages.strings.alphabet import make_alphabet
from stages.strings.compiled_grammar import CompiledGrammar, compile_grammar, patterns_json
from stages.strings.settings import StringsConfig
from stages.strings.tokens import number_value, split_tokens
from stages.training.string_vae.batches import StringCorpus
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary

Masks = npt.NDArray[np.bool_]


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `StringCorpus` of each split; `.json`, what the tokens stand for.

    The strings of train say which cycle numbers there are; strings of other splits with more are refused, and so are
    those of more than `longest` tokens, and those that train has as well; and with its first, canonical string all of a
    shape. Raises Rejected where train or val keeps no string.
    """
    name, splits, longest = task.shard.params["kit"], task.shard.params["splits"], task.shard.params["longest"]
    kit = input_kit(task, name)
    alphabet = make_alphabet(kit.labels)
    shapes: dict[str, list[list[str]]] = {}
    for done, (shard, split) in enumerate(splits.items()):
        for key, strings in _strings_of(task, name, shard):
            kept = [each for each in strings if len(split_tokens(each)) <= longest]
            kept = kept if strings[0] in kept[:1] else []  # what the others shall be written as
            refused = len(strings) - len(kept)
            if refused:
                task.reject(key, "longer than training.max_length", count=refused)
            shapes.setdefault(split, []).append(kept)
        task.progress(done + 1, len(splits))
    vocabulary = Vocabulary(alphabet, _cycles(shapes.get("train", [])))
    edges = task.config.section(StringsConfig).edges
    rules = compile_grammar(kit.grammar, len(kit.labels), vocabulary.cycles, edges != "all")
    learnt = {each for strings in shapes.get("train", []) for each in strings}
    counts, most = {}, 0
    for split, of_split in sorted(shapes.items()):
        made, needed = _numbered(task, vocabulary, rules, of_split, set() if split == "train" else learnt)
        most = max(most, needed, int(made.lengths.max(initial=1)) - 1)
        counts[split] = {"strings": len(made), "graphs": len(made.histograms), "tokens": len(made.tokens)}
        _write(task, f"{task.shard.name}.{split}.safetensors", made)
    for split in ("train", "val"):
        if not counts.get(split, {}).get("strings"):
            raise Rejected(f"kit {name} has no strings of at most {longest} tokens in split {split}")
    described = {
        "kit": name,
        "names": list(alphabet.names),
        "edges": edges,
        "cycles": vocabulary.cycles,
        "most": most,
        "patterns": patterns_json(rules),
        "counts": counts,
    }
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json_bytes(described))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], Vocabulary, dict[str, StringCorpus]]:
    """What `prepare_corpus` wrote in shard `data`: a description, the vocabulary, the strings of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    vocabulary = Vocabulary(make_alphabet(described["names"]), described["cycles"])
    paths: Mapping[str, Path] = {
        split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")
    }
    return described, vocabulary, {split: StringCorpus.of(load_file(path)) for split, path in paths.items()}


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


def _followed(rules: CompiledGrammar, vocabulary: Vocabulary, codes: npt.NDArray[np.int16]) -> tuple[Masks, int] | None:
    """`masks_along` for a string without its end; None where the rules do not admit it."""
    from stages.strings.grammar_mask import masks_along

    try:
        return masks_along(rules, vocabulary.cycles, np.append(codes, END_TOKEN).astype(np.int64))
    except ValueError:
        return None


def _numbered(
    task: Task, vocabulary: Vocabulary, rules: CompiledGrammar, shapes: list[list[str]], elsewhere: set[str]
) -> tuple[StringCorpus, int]:
    """The strings that are not `elsewhere`, with their masks, and the most tokens that any beginning of them needs."""
    types = len(vocabulary.alphabet.tokens)
    codes: list[npt.NDArray[np.int16]] = [np.empty(0, np.int16)]
    masks: list[npt.NDArray[np.uint8]] = [np.empty((0, -(-len(vocabulary) // 8)), np.uint8)]
    graph: list[int] = []
    histograms: list[npt.NDArray[np.int64]] = []
    most = 0
    for strings in shapes:
        before = len(graph)
        for place, string in enumerate(strings):
            if place and len(graph) == before:
                task.reject(string, "its canonical string was refused", count=len(strings) - place)
                break
            if string in elsewhere:
                task.reject(string, "stands in train as well")
                continue
            if not _knows(vocabulary, string):
                task.reject(string, "cycle numbers that train has not")
                continue
            each = vocabulary.codes(string)
            followed = _followed(rules, vocabulary, each)
            if followed is None:
                task.reject(string, "not admitted by the grammar")
                continue
            masks.append(np.packbits(followed[0], axis=-1, bitorder="little"))
            codes.append(np.append(each, np.int16(END_TOKEN)))
            graph.append(len(histograms))
            most = max(most, followed[1])
        if len(graph) > before:
            histograms.append(np.bincount(codes[-1], minlength=types + 1)[1 : types + 1])
    return StringCorpus(
        tokens=np.concatenate(codes),
        first=np.cumsum([len(each) for each in codes], dtype=np.int64),
        masks=np.concatenate(masks),
        graph=np.array(graph, dtype=np.int32),
        histograms=np.array(histograms, dtype=np.int32).reshape(-1, types),
    ), most


def _knows(vocabulary: Vocabulary, string: str) -> bool:
    numbers = map(number_value, split_tokens(string))
    return all(number is None or number < vocabulary.cycles for number in numbers)


def _write(task: Task, file: str, strings: StringCorpus) -> None:
    from safetensors.numpy import save

    with task.output(file) as stream:
        stream.write(save(strings.arrays()))
