"""`manifest.json` and `checksums.txt`: what the dataset consists of, and what it was made from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from pipeline.config import Config


def config_sections(config: Config) -> dict[str, Any]:
    """All sections of the config as JSON; of a file's path only the name and its folder's, since what lies above
    differs from machine to machine."""
    return {name: _portable(section.model_dump()) for name, section in config.sections.items()}


def manifest(
    facts: Mapping[str, Any],
    sections: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    files: Mapping[str, str],
    index: Mapping[str, Any],
    classes: Mapping[str, Any],
    measures: Mapping[str, Mapping[str, Any]],
    made_with: Mapping[str, Any],
    origins: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """What `manifest.json` holds. `shards` are the summaries of the package's shards; `members` says name, sentence,
    dtype and shape of each; `files` are the digests of the files about the whole but this one; `index` has `path`
    (relative to the dataset's folder), `bytes` and `sha256`, `classes` has `path`, `count` and `sha256`; `measures` of
    the variants of each kit; `made_with` versions of code and libraries; `origins` the files that the samples were
    made from, and whose they are."""
    kits: Counter[str] = Counter()
    splits: Counter[str] = Counter()
    for shard in shards:
        kits.update(shard["kits"])
        splits[shard["split"]] += shard["samples"]
    return {
        "name": facts["name"],
        "version": facts["version"],
        "seed": facts["seed"],
        "made_with": dict(made_with),
        "samples": sum(splits.values()),
        "splits": dict(splits),
        "kits": dict(kits),
        "members": [dict(each) for each in members],
        "files": dict(files),
        "shards": [
            {name: shard[name] for name in ("path", "split", "samples", "bytes", "sha256", "kits")} for shard in shards
        ],
        "index": {name: index[name] for name in ("path", "bytes", "sha256")},
        "classes": dict(classes),
        "origins": [dict(each) for each in origins],
        "measures": dict(measures),
        "config": dict(sections),
    }


def checksums(digests: Mapping[str, str]) -> str:
    """The text that `sha256sum -c` reads, for `{file: sha256}`, sorted by file."""
    return "".join(f"{digest}  {file}\n" for file, digest in sorted(digests.items()))


def _portable(value: Any) -> Any:
    if isinstance(value, PurePath):
        return "/".join(value.parts[-2:])
    if isinstance(value, Mapping):
        return {name: _portable(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_portable(each) for each in value]
    return value
