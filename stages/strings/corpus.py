"""The text corpus of a dataset: distinct strings of all shapes, one file for each kit and split."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from hashlib import blake2b
from typing import Any, BinaryIO

from pipeline.errors import ShardFailed
from pipeline.shards import read_shard
from pipeline.stage import Outcome, Task
from stages.shape.collection.assignment import SPLITS
from stages.shape.collection.members import TEXT
from stages.shape.kit_input import input_kits
from stages.strings.members import CORPUS
from stages.strings.settings import EDGE_DESCRIPTIONS, Edges, StringsConfig
from stages.strings.statistics import StringStatistics, summarize
from stages.strings.tokens import make_alphabet, number_value

__all__ = ["CORPUS", "compose_corpus"]


def compose_corpus(task: Task) -> Outcome:
    """Write the corpus.

    `<kit>-<split>.txt`: one string a line; `vocabulary.json`: for each kit its tokens, their type names, and what a
    string encodes; `statistics.json`: for each kit and split the statistics of its file.

    With all contacts, equal strings encode equal graphs. Memory then holds a digest of each graph, and the strings of
    graphs that several shapes share. With fewer contacts, shapes of different graphs may share strings, and memory
    holds a digest of every string: a training string is left out of val, and one of val out of test. Raises ShardFailed
    for shapes of one graph in different splits.
    """
    splits = dict(sorted(task.shard.params["splits"].items(), key=lambda pair: SPLITS.index(pair[1])))
    edges = task.config.section(StringsConfig).edges
    shared = _shared_graphs(task, splits)
    known: dict[tuple[str, str], set[bytes]] = {}
    statistics: dict[str, dict[str, StringStatistics]] = {}
    files: dict[str, BinaryIO] = {}
    for done, (shard, split) in enumerate(splits.items(), 1):
        for row, strings in _rows_and_strings(task, shard):
            kit, graph = row["kit"], _graph_key(row)
            name = f"{kit}-{split}.txt"
            if name not in files:
                files[name] = task.output(f"{CORPUS}.{name}")
            counted = statistics.setdefault(kit, {}).setdefault(split, StringStatistics())
            counted.add_shape(row["cycle_rank"])
            counted.graphs += not shared.get(graph)
            kept = strings
            if graph in shared:
                kept = [string for string in strings if string not in shared[graph]]
                shared[graph].update(kept)
            counted.duplicates += len(strings) - len(kept)
            if edges != "all":
                kept = _without_known(kept, kit, split, known, counted)
            for string in kept:
                counted.add(string)
            files[name].write("".join(f"{string}\n" for string in kept).encode())
        task.progress(done, len(splits))
    described = {
        kit: {split: counted.describe() for split, counted in sorted(of_splits.items())}
        for kit, of_splits in sorted(statistics.items())
    }
    for name, value in (("vocabulary.json", _vocabulary(task, statistics, edges)), ("statistics.json", described)):
        files[name] = task.output(f"{CORPUS}.{name}")
        files[name].write(_readable(value))
    counts = [counted for of_splits in statistics.values() for counted in of_splits.values()]
    summary = {
        "files": sorted(files),
        "strings": sum(counted.strings for counted in counts),
        "duplicates": sum(counted.duplicates for counted in counts),
        "in_other_splits": sum(counted.in_other_splits for counted in counts),
        "graphs": sum(counted.graphs for counted in counts),
        "edges": edges,
        "kits": {kit: summarize(of_splits.values()) for kit, of_splits in sorted(statistics.items())},
    }
    return Outcome(samples=0, summary=summary)


def _without_known(
    strings: Sequence[str], kit: str, split: str, known: dict[tuple[str, str], set[bytes]], counted: StringStatistics
) -> list[str]:
    """Return the strings that no file of the kit has; `known` holds digests of the strings of each file."""
    own = known.setdefault((kit, split), set())
    others = [digests for (other, where), digests in known.items() if other == kit and where != split]
    kept = []
    for string in strings:
        digest = blake2b(string.encode(), digest_size=16).digest()
        if digest in own:
            counted.duplicates += 1
        elif any(digest in digests for digests in others):
            counted.in_other_splits += 1
        else:
            own.add(digest)
            kept.append(string)
    return kept


def _shared_graphs(task: Task, splits: dict[str, str]) -> dict[bytes, set[str]]:
    """Return the graphs of more than one shape, each with an empty set for its strings."""
    first: dict[bytes, tuple[str, str]] = {}
    shared: dict[bytes, set[str]] = {}
    for shard, split in splits.items():
        for row in _rows(task, shard):
            graph = _graph_key(row)
            if graph not in first:
                first[graph] = (split, row["key"])
                continue
            other, key = first[graph]
            if other != split:
                raise ShardFailed(f"{row['key']} of {split} and {key} of {other} have the same graph {row['graph']}")
            shared[graph] = set()
    return shared


def _graph_key(row: dict[str, Any]) -> bytes:
    return f"{row['kit']}/".encode() + bytes.fromhex(row["graph"])


def _rows(task: Task, shard: str) -> Iterator[dict[str, Any]]:
    with open(task.input("strings", f"{shard}.jsonl"), "rb") as lines:
        for line in lines:
            yield json.loads(line)


def _rows_and_strings(task: Task, shard: str) -> Iterator[tuple[dict[str, Any], list[str]]]:
    """Yield the rows of a shard, with their strings; its tar holds texts of samples without shape graphs, too."""
    samples = read_shard(task.input("strings", f"{shard}.tar"))
    for row in _rows(task, shard):
        strings = next((members[TEXT] for key, members in samples if key == row["key"]), None)
        if strings is None:
            raise ShardFailed(f"shard {shard} lists {row['key']}, which is not in its tar at that place")
        yield row, strings.decode().splitlines()


def _vocabulary(task: Task, statistics: dict[str, dict[str, StringStatistics]], edges: Edges) -> dict[str, Any]:
    """Return, by kit: `types`, type name by token; `tokens`, all in order; `edges`, and their `meaning`."""
    described = {}
    for name, kit in sorted(input_kits(task).items()):
        if name in statistics:
            types = make_alphabet(kit.labels).vocabulary()
            seen = {token for counted in statistics[name].values() for token in counted.seen}
            numbers = sorted(seen - set(types) - {"(", ")"}, key=_number)
            tokens = [*types, "(", ")", *numbers]
            described[name] = {"types": types, "tokens": tokens, "edges": edges, "meaning": EDGE_DESCRIPTIONS[edges]}
    return described


def _number(token: str) -> int:
    number = number_value(token)
    if number is None:
        raise ShardFailed(f"the corpus has a token {token!r} that is neither a cycle number nor a type of its kit")
    return number


def _readable(value: Any) -> bytes:
    """Return JSON with one entry a line."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
