"""Stage `strings`: the strings of each sample of the collection, and the text corpus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.errors import Rejected, ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.discovery import language_of
from stages.shape.collection.members import TEXT
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_producers
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample
from stages.strings.corpus import compose_corpus
from stages.strings.encoder import NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.strings.members import CORPUS
from stages.strings.settings import StringsConfig

BYTES_PER_STRING = 3000
"""About that of a shape of two hundred parts with six hundred contacts."""


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection and, when all are done, the corpus.

    Samples without shape graphs have a text of their own. A dataset of these alone has no shard here, and one whose
    strings are turned off has none either.
    """
    shards = _graph_shards(plan)
    if not shards or any(plan.summary("strings", shard.name) is None for shard in shards):
        return shards
    splits = {shard.name: shard.params["split"] for shard in shards}
    kits = language_of(shards[0].params["producer"]).reads(plan)
    corpus = Shard(CORPUS, {"splits": splits}, (*kits, *(f"strings/{shard.name}" for shard in shards)))
    return [*shards, corpus]


def run_shard(task: Task) -> Outcome:
    """Make one shard of the plan."""
    return compose_corpus(task) if task.shard.name == CORPUS else write_strings(task)


def write_strings(task: Task) -> Outcome:
    """Write the strings of a shard.

    `.tar`: the member `txt` of each sample, one string a line, the canonical one first, or the text of a sample without
    a shape graph; `.jsonl`: key, kit, graph and cycle rank of each shape graph, for the corpus. Every string is decoded
    before it is written. A sample whose graph is not connected is rejected. Raises ShardFailed for a string that does
    not encode its graph, and for a wrong graph.
    """
    config = task.config.section(StringsConfig)
    kits = {name: KitStrings(kit, config.edges) for name, kit in input_kits(task).items()}
    written, rows = 0, []

    def strings_of(_: Collection, sample: Sample) -> Mapping[str, bytes]:
        nonlocal written
        if not language_of(sample.producer).graphs:
            return {TEXT: sample.text.encode()}
        try:
            strings = _strings(sample, kits[sample.kit], config.strings_per_shape, task.rng(sample.key))
        except NotConnectedError as error:
            raise Rejected("shape graph is not connected", str(error)) from error
        written += len(strings)
        cycle_rank = len(sample.assembly.edges) - len(sample.assembly) + 1
        rows.append({"key": sample.key, "kit": sample.kit, "graph": sample.graph, "cycle_rank": cycle_rank})
        return {TEXT: ("\n".join(strings) + "\n").encode()}

    samples = add_members(task, strings_of)
    with task.output(f"{task.shard.name}.jsonl") as listing:
        listing.writelines(json_bytes(row) for row in rows)
    return Outcome(samples, {"split": task.shard.params["split"], "strings": written})


def publish(plan: Plan) -> Mapping[str, str]:
    """Publish the corpus in a folder next to the dataset: text files, vocabulary, statistics."""
    summary = plan.summary("strings", CORPUS)
    if summary is None:
        return {}
    return {f"{plan.config.name}-corpus/{file}": f"{CORPUS}.{file}" for file in summary["files"]}


def report(plan: Plan) -> Sequence[str]:
    """Report the contents of the finished corpus, and the length of its strings."""
    summary = plan.summary("strings", CORPUS)
    if summary is None:
        return ()
    counts = f"{summary['strings']} strings of {summary['graphs']} graphs"
    others = f" and {summary['in_other_splits']} of other splits" if summary["in_other_splits"] else ""
    lengths = [
        f"{kit}: {measures['tokens']['median']:,} tokens per string (median), {measures['tokens']['most']:,} at most; "
        f"cycle rank {measures['cycle_rank']['median']:,} (median), {measures['cycle_rank']['most']:,} at most"
        for kit, measures in summary["kits"].items()
    ]
    return (f"corpus: {counts}, {summary['duplicates']} duplicates{others} dropped", *lengths)


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all strings, in the shards and in the corpus."""
    strings = plan.config.section(StringsConfig).strings_per_shape + 1
    samples = sum(int(shard.params["samples"]) for shard in _graph_shards(plan))
    return samples * (2 * strings * BYTES_PER_STRING + 2048)


def _graph_shards(plan: Plan) -> list[Shard]:
    if not plan.config.section(StringsConfig).enabled:
        return []
    graphs = any(language_of(producer).graphs for producer in sample_producers(plan))
    return collection_shards(plan) if graphs else []


def _strings(sample: Sample, kit: KitStrings, count: int, rng: np.random.Generator) -> list[str]:
    """Return the canonical string of a sample and `count` random ones, checked against its graph."""
    labelled = kit.kit.labelled(sample.assembly)
    if graph_digest(labelled.types, labelled.edges) != sample.graph:
        raise ShardFailed(f"sample {sample.key} is filed under graph {sample.graph}, which is not its own")
    graph = kit.graph(sample.assembly)
    encoded = kit.strings(graph, count, rng)
    for string in encoded:
        if not kit.represents(string, graph):
            raise ShardFailed(f"a string of sample {sample.key} does not encode its graph: {string.string}")
    return [string.string for string in encoded]


STAGE = Stage(
    name="strings",
    module=__name__,
    config=StringsConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    publish=publish,
)
