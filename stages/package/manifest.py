"""`manifest.json` and `checksums.txt`: contents and provenance of the dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from pipeline.config import Config


def config_sections(config: Config) -> dict[str, Any]:
    """Return all sections of the config as JSON; paths keep only file and folder name, which do not vary by machine."""
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
    software: Mapping[str, Any],
    origins: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """Return the content of `manifest.json`.

    shards: summaries of the package's shards
    members: name, sentence, dtype and shape of each
    files: digests of the other files about the whole dataset
    index: path relative to the dataset's folder, bytes, sha256
    classes: path, count, sha256
    measures: figures of the producers
    software: versions of code and libraries
    origins: the files that the samples were made from, with author and licence
    """
    kits: Counter[str] = Counter()
    producers: Counter[str] = Counter()
    splits: Counter[str] = Counter()
    for shard in shards:
        kits.update(shard["kits"])
        producers.update(shard["producers"])
        splits[shard["split"]] += shard["samples"]
    return {
        "name": facts["name"],
        "version": facts["version"],
        "seed": facts["seed"],
        "software": dict(software),
        "samples": sum(splits.values()),
        "splits": dict(splits),
        "kits": dict(kits),
        "producers": dict(producers),
        "members": [dict(member) for member in members],
        "files": dict(files),
        "shards": [
            {name: shard[name] for name in ("path", "split", "samples", "bytes", "sha256", "kits")} for shard in shards
        ],
        "index": {name: index[name] for name in ("path", "bytes", "sha256")},
        "classes": dict(classes),
        "origins": [dict(origin) for origin in origins],
        "measures": dict(measures),
        "config": dict(sections),
    }


def checksums(digests: Mapping[str, str]) -> str:
    """Return the text that `sha256sum -c` reads, for `{file: sha256}`, sorted by file."""
    return "".join(f"{digest}  {file}\n" for file, digest in sorted(digests.items()))


def _portable(value: Any) -> Any:
    if isinstance(value, PurePath):
        return "/".join(value.parts[-2:])
    if isinstance(value, Mapping):
        return {name: _portable(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_portable(item) for item in value]
    return value
