"""Stage `strings`: each sample of the collection gets its strings; then they become the text corpus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import Rejected, ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.declared import language_of
from stages.shape.collection.shards import PRODUCERS, collection_shards
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample
from stages.strings.alphabet import Alphabet, make_alphabet
from stages.strings.corpus import CORPUS, compose_corpus
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded, NotConnectedError, canonical_string, random_strings
from stages.strings.settings import StringsConfig

__all__ = ["STAGE"]

BYTES_A_STRING = 3000
"""About as long as the string of a shape of two hundred parts with six hundred contacts is."""


def plan(plan: Plan) -> list[Shard]:
    """One shard for each shard of the collection; when all are done, the corpus, which reads them all. None for
    samples that are no shape graphs: they come with a text of their own."""
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
    """Files of the shard: `.tar` with the member `txt` of each sample, one string a line, the canonical one first;
    and `.jsonl` with the sample's key, kit and graph for the corpus, in the same order.

    Every string is decoded again before it is written. A sample whose graph is not connected has no string and is
    refused. Raises ShardFailed where a string does not stand for its graph, or a sample is filed under a wrong graph.
    """
    config = task.config.section(StringsConfig)
    kits = input_kits(task)
    alphabets = {name: make_alphabet(kit.labels) for name, kit in kits.items()}
    written, rows = 0, []

    def strings_of(_: Collection, sample: Sample) -> Mapping[str, bytes]:
        nonlocal written
        try:
            labelled = replace(sample, assembly=kits[sample.kit].labelled(sample.assembly))
            strings = _strings(labelled, alphabets[sample.kit], config.strings_per_shape, task.rng(sample.key))
        except NotConnectedError as error:
            raise Rejected("shape graph is not connected", str(error)) from error
        written += len(strings)
        rows.append({"key": sample.key, "kit": sample.kit, "graph": sample.graph})
        return {"txt": ("\n".join(strings) + "\n").encode()}

    samples = add_members(task, strings_of)
    with task.output(f"{task.shard.name}.jsonl") as listing:
        listing.writelines(json_bytes(row) for row in rows)
    return Outcome(samples, {"split": task.shard.params["split"], "strings": written})


def publish(plan: Plan) -> Mapping[str, str]:
    """The corpus, in a folder beside the dataset's: text files, vocabulary, statistics."""
    summary = plan.summary("strings", CORPUS)
    if summary is None:
        return {}
    return {f"{plan.config.name}-corpus/{file}": f"{CORPUS}.{file}" for file in summary["files"]}


def report(plan: Plan) -> Sequence[str]:
    """One line about the corpus, once it is there."""
    summary = plan.summary("strings", CORPUS)
    if summary is None:
        return ()
    counts = f"{summary['strings']} strings of {summary['graphs']} graphs"
    return (f"corpus: {counts}, {summary['duplicates']} duplicates dropped",)


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all strings, in the shards and once more in the corpus."""
    strings = plan.config.section(StringsConfig).strings_per_shape + 1
    samples = sum(int(shard.params["samples"]) for shard in _graph_shards(plan))
    return samples * (2 * strings * BYTES_A_STRING + 2048)


def _graph_shards(plan: Plan) -> list[Shard]:
    return [each for each in collection_shards(plan) if language_of(each.params["producer"]).graphs]


def _strings(sample: Sample, alphabet: Alphabet, count: int, rng: np.random.Generator) -> list[str]:
    """The canonical string of a sample, its types being those of `alphabet`, and `count` random ones, proved to stand
    for its graph."""
    types, edges = sample.assembly.types, sample.assembly.edges
    if graph_digest(types, edges) != sample.graph:
        raise ShardFailed(f"sample {sample.key} is filed under graph {sample.graph}, which is not its own")
    canonical = canonical_string(types, edges, alphabet)
    encoded = [canonical, *random_strings(types, edges, alphabet, count, rng, {canonical.string})]
    for each in encoded:
        if not _stands_for(each, sample.assembly, alphabet):
            raise ShardFailed(f"a string of sample {sample.key} does not stand for its graph: {each.string}")
    return [each.string for each in encoded]


def _stands_for(encoded: Encoded, assembly: Assembly, alphabet: Alphabet) -> bool:
    """Whether the string, decoded, is the graph of `assembly` under the encoder's own matching of their nodes."""
    decoded = decode(encoded.string, alphabet)
    if sorted(encoded.nodes.tolist()) != list(range(len(assembly))):
        return False
    if not np.array_equal(decoded.types, assembly.types[encoded.nodes]):
        return False
    found = np.sort(encoded.nodes[decoded.edges], axis=1)
    keys, expected = found @ (len(assembly), 1), np.sort(assembly.edges, axis=1) @ (len(assembly), 1)
    return np.array_equal(np.sort(keys), np.sort(expected))


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
