"""Checks of a dataset's files: checksums, listings, index, splits."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

from pipeline.paths import file_digest
from stages.package.layout import CHECKSUMS, CLASSES, CROISSANT, INDEX, MANIFEST, SCHEMA
from stages.package.schema import validator_of
from stages.verification.findings import Findings

SampleRow = tuple[str, str, str, str, str, str]
"""Key, shard, split, kit, graph and producer of a sample."""

ClassCounts = Counter[tuple[str, str, str]]
"""Numbers of `shapes` and `parts` by (`shapes` or `parts`, split, class)."""

_COUNTS = {"type": "object", "additionalProperties": {"type": "integer", "minimum": 0}}
_MEMBER = {"name": {"type": "string"}, "dtype": {"type": "string"}, "shape": {"type": "array"}}
_FILE = {"path": {"type": "string"}, "sha256": {"type": "string"}, "bytes": {"type": "integer"}}
_SHARD = {**_FILE, "split": {"type": "string"}, "samples": {"type": "integer", "minimum": 0}}


def _object(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(properties), "required": list(properties)}


MANIFEST_SCHEMA = _object(
    {
        "samples": {"type": "integer", "minimum": 1},
        "splits": _COUNTS,
        "kits": _COUNTS,
        "members": {"type": "array", "items": _object(_MEMBER)},
        "files": {"type": "object", "additionalProperties": {"type": "string"}},
        "shards": {"type": "array", "items": _object(_SHARD)},
        "index": _object(_FILE),
        "config": {"type": "object", "additionalProperties": {"type": "object"}},
    }
)
"""JSON schema of the fields that verification reads."""


def check_files(folder: Path, findings: Findings) -> tuple[dict[str, Any], set[str]] | None:
    """Check the files of a dataset; return its manifest and the files with the right bytes.

    Returns None where the manifest cannot be read. Never raises for faults of the files.
    """
    listed = _listed(folder, findings)
    whole = _check_bytes(folder, listed, findings)
    manifest = read_document(folder / MANIFEST, findings)
    if manifest is None:
        return None
    error = best_match(Draft202012Validator(MANIFEST_SCHEMA).iter_errors(manifest))
    if error is not None:
        findings.fault("manifest", MANIFEST, f"is invalid: {error.json_path}: {error.message}")
        return None
    _check_listing(folder, listed, manifest, findings)
    return manifest, whole


def read_document(path: Path, findings: Findings) -> dict[str, Any] | None:
    """Return the JSON object in a file; None, with a fault, where it has none."""
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        findings.fault("manifest", path.name, f"cannot be read: {error}")
        return None
    if not isinstance(document, dict):
        findings.fault("manifest", path.name, "is no JSON object")
        return None
    return document


def read_schema(folder: Path, findings: Findings) -> str:
    """Return the schema of the records as text; where it cannot be read, one that allows everything, with a fault."""
    from jsonschema import SchemaError

    document = read_document(folder / SCHEMA, findings)
    if document is None:
        return "{}"
    schema = json.dumps(document)
    try:
        validator_of(schema)
    except SchemaError as error:
        findings.fault("manifest", SCHEMA, f"is no JSON schema: {error.message}")
        return "{}"
    return schema


def check_splits(manifest: Mapping[str, Any], rows: Sequence[SampleRow], findings: Findings) -> None:
    """Check that keys are unique, that graphs share a split if the manifest requires it, and the counts of splits.

    rows: result of `check_shard` for each sample of each readable shard
    """
    seen: dict[str, str] = {}
    graphs: dict[tuple[str, str], tuple[str, str]] = {}
    sharing = manifest.get("graphs_share_split")
    for key, shard, split, kit, graph, producer in rows:
        where = f"{shard}: {key}"
        if key in seen:
            findings.fault("samples", where, f"is also in {seen[key]}, or its members do not follow each other")
        seen[key] = shard
        if sharing is True or (isinstance(sharing, list) and producer in sharing):
            first_split, first = graphs.setdefault((kit, graph), (split, key))
            if first_split != split:
                findings.fault("splits", where, f"has the graph of {first}, which is in {first_split}")
    findings.look("splits", len(rows))
    for split, samples in manifest["splits"].items():
        count = sum(row[2] == split for row in rows)
        if count != samples and len(rows) == manifest["samples"]:
            findings.fault("splits", MANIFEST, f"counts {samples} samples of {split}, the shards have {count}")


def check_classes(folder: Path, tally: ClassCounts, findings: Findings) -> None:
    """Check the numbers of shapes and parts of each class and split in `classes.json`."""
    try:
        listed = json.loads((folder / CLASSES).read_bytes())
        stated = {
            (what, split, str(row["id"])): count
            for row in listed
            for what in ("shapes", "parts")
            for split, count in row[what].items()
            if count
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        findings.fault("classes", CLASSES, f"cannot be read: {type(error).__name__}: {error}")
        return
    findings.look("classes", len(listed))
    for what, split, number in sorted(stated.keys() | tally.keys()):
        counted, actual = stated.get((what, split, number), 0), tally[what, split, number]
        if counted != actual:
            findings.fault(
                "classes", CLASSES, f"counts {counted} {what} of class {number} in {split}; there are {actual}"
            )


def _listed(folder: Path, findings: Findings) -> dict[str, str]:
    """Return `{file: sha256}` of the checksums file."""
    try:
        lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        findings.fault("checksums", CHECKSUMS, f"cannot be read: {error}")
        return {}
    listed = {file: digest for digest, _, file in (line.partition("  ") for line in lines)}
    for file in [name for name in listed if not name or ".." in Path(name).parts or Path(name).is_absolute()]:
        findings.fault("checksums", CHECKSUMS, f"names {file!r}, which is no file inside the dataset")
        del listed[file]
    return listed


def _check_bytes(folder: Path, listed: Mapping[str, str], findings: Findings) -> set[str]:
    """Return the listed files with the right bytes; others and foreign files become faults."""
    whole = set()
    for file, digest in listed.items():
        findings.look("checksums")
        path = folder / file
        if path.is_symlink() or not path.is_file():
            findings.fault("missing files", file, "is missing")
        elif file_digest(path) != digest:
            findings.fault("checksums", file, f"is corrupted: its sha256 is not the one in {CHECKSUMS}")
        else:
            whole.add(file)
    findings.look("missing files", len(listed))
    _check_foreign(folder, "", {*listed, CHECKSUMS}, "the dataset", findings)
    return whole


def _check_foreign(folder: Path, before: str, known: set[str], whose: str, findings: Findings) -> None:
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        findings.look("foreign files")
        if path.is_symlink():
            findings.fault("foreign files", before + name, "is a link; a dataset has files of its own")
        elif path.is_dir():
            if not any(path.iterdir()):
                findings.fault("foreign files", before + name, "is an empty folder")
        elif name not in known:
            findings.fault("foreign files", before + name, f"does not belong to {whose}")


def _check_listing(folder: Path, listed: Mapping[str, str], manifest: Mapping[str, Any], findings: Findings) -> None:
    """Check that manifest, checksums and Croissant name the same files and digests, and that counts add up."""
    shards = {shard["path"]: shard["sha256"] for shard in manifest["shards"]}
    digests = {**shards, **manifest["files"]}
    others = {CHECKSUMS: ({file: digest for file, digest in listed.items() if file != MANIFEST}, digests)}
    croissant = read_document(folder / CROISSANT, findings)
    if croissant is not None:
        given = croissant.get("distribution")
        files = [item for item in given if isinstance(item, dict)] if isinstance(given, list) else []
        named = {str(item.get("@id")): item["sha256"] for item in files if "sha256" in item}
        own = digests | {INDEX: manifest["index"]["sha256"]}
        others[CROISSANT] = (named, {file: own.get(file) for file in named} | shards)
    findings.look("manifest", len(digests))
    for name, (other, own) in others.items():
        for file in sorted({*own, *other}):
            if own.get(file) != other.get(file):
                findings.fault("manifest", file, f"{MANIFEST} and {name} disagree")
    for split, samples in manifest["splits"].items():
        if samples != sum(shard["samples"] for shard in manifest["shards"] if shard["split"] == split):
            findings.fault("manifest", MANIFEST, f"its shards of split {split} do not add up to {samples} samples")
    if manifest["samples"] != sum(manifest["splits"].values()) or manifest["samples"] != sum(manifest["kits"].values()):
        findings.fault("manifest", MANIFEST, f"its splits or kits do not add up to {manifest['samples']} samples")
    for shard in manifest["shards"]:
        parts, split = Path(shard["path"]).parts, shard["split"]
        if parts[:2] != ("data", split) or ".." in parts or f"-{split}-" not in parts[-1]:
            findings.fault("splits", shard["path"], f"is a shard of {split}, but its path is of another")


def check_index(folder: Path, manifest: Mapping[str, Any], findings: Findings) -> Path | None:
    """Check that the index exists, alone in its folder, with the right bytes and size; return its path, else None."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder.parent / f"{folder.name}-index" / Path(str(manifest["index"]["path"])).name
    name = f"../{path.parent.name}/{path.name}"
    if not path.is_file():
        findings.fault("missing files", name, "is missing")
        return None
    findings.look("checksums")
    _check_foreign(path.parent, f"../{path.parent.name}/", {path.name}, "the index", findings)
    if file_digest(path) != manifest["index"]["sha256"]:
        findings.fault("checksums", name, f"is corrupted: its sha256 is not the one in {MANIFEST}")
        return None
    try:
        metadata = pq.read_metadata(path)
    except (pa.ArrowException, OSError) as error:
        findings.fault("index", name, f"cannot be read: {error}")
        return None
    if metadata.num_rows != manifest["samples"]:
        findings.fault("index", name, f"has {metadata.num_rows} rows for {manifest['samples']} samples")
    return path
