"""Whether a dataset's files are whole, all there, and say the same: checksums, members, counts, index."""

from __future__ import annotations

import json
import tarfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.places import file_digest
from pipeline.shards import bytes_array
from stages.package.croissant import INDEX
from stages.package.layout import CHECKSUMS, CROISSANT, MANIFEST
from stages.shape.collection.pairs import CONTACTS, pairs_of

__all__ = ["FileFindings", "check_files", "empty_values", "shard_samples"]

PER_POINT = ("points.npy", "normals.npy", "labels.npy", "instances.npy")


@dataclass
class FileFindings:
    """What was looked at, by check, how often, and what is wrong with it, each named."""

    checked: dict[str, int] = field(default_factory=dict)
    faults: dict[str, list[str]] = field(default_factory=dict)

    def look(self, check: str, count: int = 1) -> None:
        """Note that `check` has looked at `count` more things."""
        self.checked[check] = self.checked.get(check, 0) + count

    def fault(self, check: str, where: str, what: str) -> None:
        """Note a fault of `where`."""
        self.faults.setdefault(check, []).append(f"{where}: {what}")


def check_files(folder: Path) -> FileFindings:
    """Check the dataset in `folder` and the index beside it. Never raises for what it finds in the files."""
    findings = FileFindings()
    listed = _listed(folder, findings)
    whole = _check_bytes(folder, listed, findings)
    if MANIFEST not in whole:
        findings.fault("manifest", MANIFEST, "is not whole, so nothing is compared with it")
        return findings
    manifest = json.loads((folder / MANIFEST).read_text())
    described = json.loads((folder / CROISSANT).read_text()) if CROISSANT in whole else None
    _check_listing(listed, manifest, described, findings)
    index = _check_index(folder, manifest, findings)
    keys: dict[str, str] = {}
    for shard in manifest["shards"]:
        if shard["path"] in whole:
            _check_shard(folder, shard, manifest, index, keys, findings)
    return findings


def shard_samples(path: Path) -> Iterator[tuple[str, int, dict[str, bytes]]]:
    """The samples of a shard in order: key, offset of the first header, members by name after the key."""
    with tarfile.open(path, mode="r:") as tar:
        key, offset, members = "", 0, dict[str, bytes]()
        for entry in tar:
            own, _, member = entry.name.partition(".")
            if own != key and members:
                yield key, offset, members
            if own != key:
                key, offset, members = own, entry.offset, {}
            stored = tar.extractfile(entry)
            members[member] = stored.read() if stored is not None else b""
            tar.members = []  # type: ignore[attr-defined]  # tarfile would keep every header it has seen
        if members:
            yield key, offset, members


def empty_values(value: Any, place: str = "") -> Iterator[str]:
    """Where in a JSON value a null, an empty text, list or mapping stands: `parts[3].label`."""
    if value is None or value in ("", [], {}):
        yield place or "the whole"
    elif isinstance(value, Mapping):
        for name, each in value.items():
            yield from empty_values(each, f"{place}.{name}" if place else name)
    elif isinstance(value, list):
        for position, each in enumerate(value):
            yield from empty_values(each, f"{place}[{position}]")


def _listed(folder: Path, findings: FileFindings) -> dict[str, str]:
    """`{file: sha256}` of the checksums file."""
    try:
        lines = (folder / CHECKSUMS).read_text().splitlines()
        return {file: digest for digest, _, file in (line.partition("  ") for line in lines)}
    except (OSError, ValueError) as error:
        findings.fault("checksums", CHECKSUMS, f"cannot be read: {error}")
        return {}


def _check_bytes(folder: Path, listed: Mapping[str, str], findings: FileFindings) -> set[str]:
    """The listed files that are there with the bytes they should have; the others and foreign ones become faults."""
    whole = set()
    for file, digest in listed.items():
        findings.look("checksums")
        path = folder / file
        if not path.is_file():
            findings.fault("missing files", file, "is missing")
        elif file_digest(path) != digest:
            findings.fault("checksums", file, f"is corrupted: its sha256 is not the one in {CHECKSUMS}")
        else:
            whole.add(file)
    findings.look("missing files", len(listed))
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if not path.is_dir():
            findings.look("foreign files")
            if name not in listed and name != CHECKSUMS:
                findings.fault("foreign files", name, "does not belong to the dataset")
    return whole


def _check_listing(
    listed: Mapping[str, str], manifest: Mapping[str, Any], croissant: Mapping[str, Any] | None, findings: FileFindings
) -> None:
    """Manifest, checksums and Croissant name the same shards with the same digests, Croissant also the index."""
    digests = {shard["path"]: shard["sha256"] for shard in manifest["shards"]}
    others = {CHECKSUMS: {file: digest for file, digest in listed.items() if file.startswith("data/")}}
    if croissant is not None:
        stated = {each["@id"]: each["sha256"] for each in croissant["distribution"] if "sha256" in each}
        if stated.pop(INDEX, None) != manifest["index"]["sha256"]:
            findings.fault(
                "manifest", manifest["index"]["path"], f"{MANIFEST} and {CROISSANT} do not say the same of it"
            )
        others[CROISSANT] = stated
    findings.look("manifest", len(digests))
    for name, other in others.items():
        for file in sorted({*digests, *other}):
            if digests.get(file) != other.get(file):
                findings.fault("manifest", file, f"{MANIFEST} and {name} do not say the same of it")
    for split, samples in manifest["splits"].items():
        if samples != sum(shard["samples"] for shard in manifest["shards"] if shard["split"] == split):
            findings.fault("manifest", MANIFEST, f"its shards of split {split} do not add up to {samples} samples")


def _check_index(folder: Path, manifest: Mapping[str, Any], findings: FileFindings) -> dict[str, dict[str, Any]] | None:
    """The rows of the index by key, or None where it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    name, path = manifest["index"]["path"], folder / manifest["index"]["path"]
    if not path.is_file():
        findings.fault("missing files", name, "is missing")
        return None
    findings.look("checksums")
    if file_digest(path) != manifest["index"]["sha256"]:
        findings.fault("checksums", name, f"is corrupted: its sha256 is not the one in {MANIFEST}")
        return None
    for other in sorted(path.parent.iterdir()):
        findings.look("foreign files")
        if other.name != path.name:
            findings.fault("foreign files", f"../{path.parent.name}/{other.name}", "does not belong to the index")
    try:
        rows = pq.read_table(path).to_pylist()
    except (pa.ArrowException, OSError) as error:
        findings.fault("index", name, f"cannot be read: {error}")
        return None
    if len(rows) != manifest["samples"]:
        findings.fault("index", name, f"has {len(rows)} rows, the manifest counts {manifest['samples']} samples")
    return {row["key"]: row for row in rows}


def _check_shard(
    folder: Path,
    shard: Mapping[str, Any],
    manifest: Mapping[str, Any],
    index: Mapping[str, Mapping[str, Any]] | None,
    keys: dict[str, str],
    findings: FileFindings,
) -> None:
    """The samples of one whole shard. `keys` collects which shard has which key."""
    path, wanted, count = shard["path"], manifest["members"], 0
    try:
        for key, offset, members in shard_samples(folder / path):
            count += 1
            findings.look("samples")
            if key in keys:
                findings.fault("samples", f"{path}: {key}", f"stands also in {keys[key]}, or its members lie apart")
            keys[key] = path
            if list(members) != wanted:
                findings.fault("samples", f"{path}: {key}", f"has members {', '.join(members)}; not as the others")
                continue
            for what in _sample_faults(key, shard["split"], members):
                findings.fault("samples", f"{path}: {key}", what)
            if index is not None:
                findings.look("index")
                row = index.get(key)
                if row is None or (row["shard"], row["offset"], row["split"]) != (path, offset, shard["split"]):
                    findings.fault("index", f"{path}: {key}", "is not where the index says, or not in it")
    except (tarfile.TarError, KeyError, ValueError) as error:
        findings.fault("samples", path, f"cannot be read after {count} samples: {error}")
    if count != shard["samples"]:
        findings.fault("samples", path, f"has {count} samples, the manifest counts {shard['samples']}")


def _sample_faults(key: str, split: str, members: Mapping[str, bytes]) -> Iterator[str]:
    record = json.loads(members["json"])
    if record.get("key") != key or record.get("split") != split:
        yield "its json names another key or split"
    empty = list(empty_values(record))
    if empty:
        yield f"its json has nothing at {', '.join(empty[:3])}"
    counts = {"parts": len(record["parts"]), "contacts": len(pairs_of(members[CONTACTS]))}
    for name, count in counts.items():
        if record["counts"][name] != count:
            yield f"its json counts {record['counts'][name]} {name} and lists {count}"
    arrays = {name: bytes_array(members[name]) for name in PER_POINT}
    if len({len(array) for array in arrays.values()}) != 1:
        yield "its point arrays differ in length"
    else:
        types = np.array([part["class"] for part in record["parts"]])
        instances = arrays["instances.npy"]
        if instances.min() < 0 or instances.max() >= len(types):
            yield "its points name parts that are not there"
        elif (types[instances] != arrays["labels.npy"]).any():
            yield "its point labels are not the classes of their parts"
    for name, content in members.items():
        if name.endswith(".png") and not content.startswith(b"\x89PNG\r\n\x1a\n"):
            yield f"{name} is no PNG"
    if not members["glb"].startswith(b"glTF"):
        yield "glb is no GLB"
