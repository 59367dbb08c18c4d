"""The programs of a category, made ready for a language model: read once from the collection, as words."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.program_lm.batches import WordCorpus, WordSequence
from stages.training.program_lm.partial_program import PartialProgram
from stages.training.program_lm.tokens import Word, program_words, step_values
from stages.training.program_vae.corpus import category_programs

Corpus = tuple[dict[str, Any], FloatArray, dict[str, WordCorpus]]


def prepare_corpus(task: Task) -> Outcome:
    """Prepare the programs of a category as words.

    Files of the shard:
        `.<split>.safetensors`: the `WordCorpus` of train and val
        `.values.safetensors`: the values of number steps
        `.json`: counts, unit of length, words of the longest program

    Programs of more than `longest` words, and those that break a rule, are refused. Raises Rejected where train or val
    keeps no program.
    """
    from safetensors.numpy import save

    params, name = task.shard.params, task.shard.name
    read = {split: list(category_programs(task, split)) for split in ("train", "val")}
    unit = max((max(program.root.bbox.dims) for _, program in read["train"]), default=1.0)
    worded = {split: _worded(task, programs, unit) for split, programs in read.items()}
    values = step_values([words for _, words in worded["train"]])
    counts: dict[str, dict[str, int]] = {}
    longest = 0
    for split, programs in worded.items():
        kept: list[WordSequence] = []
        for key, words in programs:
            found = word_sequence(words, values, unit)
            if found is None:
                task.reject(key, "breaks a rule of the language")
            else:
                kept.append(found)
        if not kept:
            raise Rejected(f"{params['kit']} has no programs of at most {params['longest']} words in split {split}")
        texts = WordCorpus.of(kept)
        counts[split] = {"programs": len(texts), "words": len(texts.words)}
        longest = max(longest, int(np.diff(texts.first).max()))
        with task.output(f"{name}.{split}.safetensors") as stream:
            stream.write(save(texts.arrays()))
    with task.output(f"{name}.values.safetensors") as stream:
        stream.write(save({"values": values}))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"counts": counts, "unit": unit, "longest": longest}))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> Corpus:
    """What `prepare_corpus` wrote in shard `data`: what it says of itself, values, the programs of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {part: task.input("training", f"{data}.{part}.safetensors") for part in ("values", "train", "val")}
    values: FloatArray = load_file(paths.pop("values"))["values"]
    return described, values, {split: WordCorpus.of_arrays(load_file(path)) for split, path in paths.items()}


def word_sequence(words: list[Word], values: FloatArray, unit: float) -> WordSequence | None:
    """A program as it is written, word by word; None where a word is not allowed."""
    text = PartialProgram(values, unit)
    cues, seen = [], []
    for _, word, _ in words:
        if not text.allowed()[word]:
            return None
        cues.append(text.cue)
        seen.append(text.seen())
        text.take(word, fit=False)
    return WordSequence(np.array([word for _, word, _ in words]), np.array(cues), np.array(seen, np.float32))


def _worded(task: Task, programs: list[tuple[str, AssemblyProgram]], unit: float) -> list[tuple[str, list[Word]]]:
    """The words of programs, by their keys."""
    found = []
    for key, program in programs:
        try:
            words = program_words(program, unit)
        except ProgramError as error:
            task.reject(key, error.reason, str(error))
            continue
        if len(words) > task.shard.params["longest"]:
            task.reject(key, "longer than training.max_length")
            continue
        found.append((key, words))
    return found
