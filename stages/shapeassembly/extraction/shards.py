"""The shards of the extraction: each reads many hierarchies and writes their programs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Shard, Task
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.settings import Cleaning, Gates, HierarchyFiles
from stages.shapeassembly.syntax.printer import print_program

HIERARCHIES_PER_SHARD = 1000
"""About a minute of work."""


@dataclass(frozen=True)
class ProgramText:
    """A program from a shard: the name of its source in the config, its own in the source, its text."""

    kit: str
    name: str
    text: str


def extraction_shards(dataset: str, hierarchies: Sequence[HierarchyFiles]) -> list[Shard]:
    """Return the shards `<dataset>-extraction-<number>`, of one source each, in the order of the config."""
    shards: list[Shard] = []
    for index, files in enumerate(hierarchies):
        source = files.source
        for first in range(0, len(source), HIERARCHIES_PER_SHARD):
            last = min(first + HIERARCHIES_PER_SHARD, len(source))
            params = {"job": "extraction", "source": index, "first": first, "last": last}
            name = f"{dataset}-extraction-{len(shards):06d}"
            shards.append(Shard(name, {**params, "digest": source.digest(first, last)}))
    return shards


def run_extraction(task: Task, hierarchies: Sequence[HierarchyFiles], gates: Gates, cleaning: Cleaning) -> Outcome:
    """Extract the programs of one shard into `.jsonl`, one a line; others are rejected by reason."""
    params = task.shard.params
    files = hierarchies[params["source"]]
    rows, scores = [], []
    for done, (name, hierarchy) in enumerate(files.source.read(params["first"], params["last"])):
        task.progress(done, params["last"] - params["first"])
        try:
            if isinstance(hierarchy, Rejected):
                raise hierarchy
            extraction = extract(hierarchy, files.rules, gates, cleaning)
        except Rejected as error:
            task.reject(f"{files.name}/{name}", error.reason, error.detail)
            continue
        rows.append({"kit": files.name, "name": name, "text": print_program(extraction.program)})
        scores.append(extraction.f_score)
    with task.output(f"{task.shard.name}.jsonl") as stream:
        stream.writelines(json_bytes(row) for row in rows)
    return Outcome(0, {"programs": len(rows), "f_score": round(float(np.mean(scores or [0.0])), 2)})


def read_program_texts(task: Task) -> Iterator[ProgramText]:
    """Yield the programs of all shards among the inputs of a task, in order."""
    for record in task.shard.inputs:
        stage, shard = record.split("/")
        for line in task.input(stage, f"{shard}.jsonl").read_text(encoding="utf-8").splitlines():
            yield ProgramText(**json.loads(line))
