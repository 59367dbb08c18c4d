"""Prepare the programs of a category as words."""

from __future__ import annotations

import numpy as np

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.corpus import category_programs, write_arrays, write_description
from stages.training.program_lm.batches import WordCorpus, WordSequence
from stages.training.program_lm.partial_program import PartialProgram
from stages.training.program_lm.tokens import Word, program_words, step_values


def prepare(task: Task) -> Outcome:
    """Prepare the programs of train and val.

    Files of the shard:
        `.<split>.safetensors`: the `WordCorpus` of each split
        `.values.safetensors`: the values of number steps, see `step_values`
        `.json`: counts, unit of length, words of the longest program
    Rejects programs of more than `max_length` words, and those that break a rule. Raises Rejected where a split keeps
    no program.
    """
    params, name = task.shard.params, task.shard.name
    programs = {split: list(category_programs(task, split)) for split in ("train", "val")}
    unit = max((max(program.root.bbox.dims) for _, program in programs["train"]), default=1.0)
    worded = {split: _worded(task, of_split, unit) for split, of_split in programs.items()}
    values = step_values([words for _, words in worded["train"]])
    counts: dict[str, dict[str, int]] = {}
    longest = 0
    for split, of_split in worded.items():
        kept: list[WordSequence] = []
        for key, words in of_split:
            sequence = word_sequence(words, values, unit)
            if sequence is None:
                task.reject(key, "breaks a rule of the language")
            else:
                kept.append(sequence)
        if not kept:
            raise Rejected(f"{params['kit']} has no programs of at most {params['max_length']} words in split {split}")
        corpus = WordCorpus.of(kept)
        counts[split] = {"programs": len(corpus), "words": len(corpus.words)}
        longest = max(longest, int(np.diff(corpus.first).max()))
        write_arrays(task, f"{name}.{split}.safetensors", corpus.arrays())
    write_arrays(task, f"{name}.values.safetensors", {"values": values})
    write_description(task, {"counts": counts, "unit": unit, "longest": longest})
    return Outcome(samples=0, summary=counts)


def word_sequence(words: list[Word], values: FloatArray, unit: float) -> WordSequence | None:
    """Return a program with the model's inputs before each word, or None where a word is not allowed."""
    program = PartialProgram(values, unit)
    cues, sizes = [], []
    for _, word, _ in words:
        if not program.allowed()[word]:
            return None
        cues.append(program.cue)
        sizes.append(program.size_inputs())
        program.take(word, fit=False)
    return WordSequence(np.array([word for _, word, _ in words]), np.array(cues), np.array(sizes, np.float32))


def _worded(task: Task, programs: list[tuple[str, AssemblyProgram]], unit: float) -> list[tuple[str, list[Word]]]:
    """Return the words of programs, with their keys."""
    worded = []
    for key, program in programs:
        try:
            words = program_words(program, unit)
        except ProgramError as error:
            task.reject(key, error.reason, str(error))
            continue
        if len(words) > task.shard.params["max_length"]:
            task.reject(key, "longer than training.max_length")
            continue
        worded.append((key, words))
    return worded
