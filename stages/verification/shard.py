"""Verification of one shard of a finished dataset, sample by sample; shards are verified in parallel."""

from __future__ import annotations

import json
import tarfile
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from pipeline.paths import DatasetPaths
from pipeline.shards import read_shard
from stages.package.index import index_row, tar_bytes
from stages.package.layout import CLASSES
from stages.package.schema import schema_faults, validator_of
from stages.shape.collection.classes import read_labels
from stages.shape.collection.discovery import audits, languages
from stages.shape.collection.discovery import members as declared_members
from stages.shape.collection.language import RebuildShape
from stages.shape.collection.packaged import PackagedSample
from stages.verification.files import ClassCounts, SampleRow
from stages.verification.findings import Findings
from stages.verification.samples import (
    SampleError,
    array_faults,
    read_packaged,
    read_sample_record,
    record_faults,
    sample_faults,
)


def check_shard(
    folder: Path,
    shard: Mapping[str, Any],
    manifest: Mapping[str, Any],
    schema: str,
    index: Path | None,
    rechecked: Collection[int],
    marks: Path,
) -> tuple[Findings, list[SampleRow], ClassCounts]:
    """Verify a shard of the dataset in `folder`; return its findings, a row for each sample, and its class counts.

    shard: its entry in the manifest
    schema: schema of the records, as JSON
    index: path of the index, if it can be read
    rechecked: indices of the samples that are rechecked by independent means, which is slow
    marks: file to which a byte is added for each sample, for whoever shows the progress
    """
    findings, rows, tally, path = Findings(), list[SampleRow](), ClassCounts(), str(shard["path"])
    paths = DatasetPaths(folder.resolve().parent, folder.resolve().name)
    rebuild = _Rebuilders(paths)
    validator = validator_of(schema)
    labels = read_labels(folder / CLASSES)
    wanted = [member["name"] for member in manifest["members"]]
    stage_samples, indexed = _stage_samples(paths, path), _indexed(index, path)
    try:
        for number, (key, offset, members) in enumerate(shard_samples(folder / path)):
            _add_byte(marks)
            findings.look("samples")
            where = f"{path}: {key}"
            if list(members) != wanted:
                findings.fault("samples", where, f"has members {', '.join(members)}; unlike the others")
                continue
            for what in _foreign(key, members, stage_samples):
                findings.fault("samples", where, what)
            row = (indexed or {}).pop(key, None)
            try:
                record = read_sample_record(members["json"])
                for what in (
                    *record_faults(record, key, shard["split"], manifest["kits"]),
                    *schema_faults(validator, record),
                    *_altered(key, record, stage_samples),
                ):
                    findings.fault("samples", where, what)
                if indexed is not None:
                    findings.look("index")
                    for what in _misplaced(row, record, path, offset, tar_bytes(members)):
                        findings.fault("index", where, what)
                split, kit, graph, producer = (str(record.get(name)) for name in ("split", "kit", "graph", "producer"))
                rows.append((key, path, split, kit, graph, producer))
                tally.update(_classes_of(record, str(shard["split"])))
                sample = read_packaged(key, record, members, rebuild, manifest["config"], labels)
                if number in rechecked:
                    findings.look("geometry")
                for check, what in _faults(sample, manifest, paths if number in rechecked else None):
                    findings.fault(check, where, what)
            except SampleError as error:
                findings.fault("samples", where, str(error))
            except LookupError as error:
                findings.skip(f"{error}: make the dataset here to check its samples")
    except (tarfile.TarError, OSError, ValueError) as error:
        findings.fault("samples", path, f"cannot be read after {findings.checked.get('samples', 0)} samples: {error}")
    for key in indexed or ():
        findings.fault("index", f"{path}: {key}", "is in the index and not in the shard")
    count = findings.checked.get("samples", 0)
    if count != shard["samples"]:
        findings.fault("samples", path, f"has {count} samples, the manifest counts {shard['samples']}")
    return findings, rows, tally


def _add_byte(path: Path) -> None:
    # Where the temporary folder is full or gone, the progress is not shown, and the verification goes on.
    with suppress(OSError), open(path, "ab") as stream:
        stream.write(b".")


class _Rebuilders(dict[str, RebuildShape]):
    """Functions that rebuild the shapes of records, by language; each reads its kits when it is first asked for."""

    def __init__(self, paths: DatasetPaths) -> None:
        super().__init__()
        self._paths = paths

    def __missing__(self, language: str) -> RebuildShape:
        self[language] = languages()[language].rebuild(self._paths)
        return self[language]


def shard_samples(path: Path) -> Iterator[tuple[str, int, dict[str, bytes]]]:
    """Yield the samples of a shard in order: key, offset of the first header, members by name."""
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
            tar.members = []  # type: ignore[attr-defined]  # tarfile would keep every header
        if members:
            yield key, offset, members


def _faults(
    sample: PackagedSample, manifest: Mapping[str, Any], paths: DatasetPaths | None
) -> Iterator[tuple[str, str]]:
    """Yield check and fault of a sample; with `paths` it is also rechecked by independent means."""
    try:
        yield from (("samples", what) for what in array_faults(sample, manifest["members"]))
        yield from (("samples", what) for what in sample_faults(sample))
        if paths is not None:
            for audit in audits().values():
                yield from (("geometry", what) for what in audit.recheck(sample, paths))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        yield "samples", f"its json is invalid: {type(error).__name__}: {error}"


def _classes_of(record: Mapping[str, Any], split: str) -> ClassCounts:
    """Count the parts of each class in a record, and one shape for each class."""
    parts = record.get("parts")
    listed = [part["class"] for part in parts if isinstance(part, dict) and "class" in part] if parts else []
    counted = Counter({("parts", split, str(number)): count for number, count in Counter(map(str, listed)).items()})
    counted.update({("shapes", split, number): 1 for number in set(map(str, listed))})
    return counted


def _indexed(index: Path | None, path: str) -> dict[str, dict[str, Any]] | None:
    """Return the index rows of a shard's samples, by key; None without an index."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if index is None:
        return None
    try:
        return {row["key"]: row for row in pq.read_table(index, filters=[("shard", "==", path)]).to_pylist()}
    except (pa.ArrowException, OSError, KeyError):
        return {}


def _misplaced(
    row: Mapping[str, Any] | None, record: Mapping[str, Any], path: str, offset: int, size: int
) -> Iterator[str]:
    """Yield a fault where the index row of a sample is missing or wrong."""
    if row is None:
        yield "is not where the index says, or not in it"
        return
    with suppress(KeyError, TypeError):  # other checks report a record without these fields
        wanted = index_row(record, path, offset, size)
        wrong = [name for name in wanted if row.get(name) != wanted[name]]
        if wrong:
            yield f"the index has another {', '.join(wrong)}"


@dataclass(frozen=True)
class StageSample:
    """A sample of a stage: the digest of each member, and fields of the record."""

    digests: Mapping[str, bytes]
    fields: Mapping[str, Any]


_SamplesByStage = Mapping[str, Mapping[str, StageSample]]


def _stage_samples(paths: DatasetPaths, path: str) -> dict[str, dict[str, StageSample]]:
    """Return the samples of a shard by stage and key, where the work folder still has them."""
    name, _, number = Path(path).stem.rpartition("-")
    shard = f"{paths.dataset}-{name.rpartition('-')[2]}-{number}"
    samples: dict[str, dict[str, StageSample]] = {}
    for stage in declared_members():
        tar = paths.stage(stage).root / f"{shard}.tar"
        with suppress(tarfile.TarError, OSError, ValueError):  # the check of the engine reports corrupted shards
            if tar.is_file():
                samples[stage] = {
                    key: StageSample(
                        {member: sha256(content).digest() for member, content in members.items() if member != "json"},
                        json.loads(members.get("json", b"{}")),
                    )
                    for key, members in read_shard(tar)
                }
    return samples


def _foreign(key: str, members: Mapping[str, bytes], stage_samples: _SamplesByStage) -> Iterator[str]:
    """Yield a fault for each member that differs from that of its stage."""
    for stage, samples in stage_samples.items():
        if key not in samples:
            yield f"is no sample of stage {stage}"
            continue
        for name, digest in samples[key].digests.items():
            if name in members and sha256(members[name]).digest() != digest:
                yield f"{name} is not the one that stage {stage} made for it"


def _altered(key: str, record: Mapping[str, Any], stage_samples: _SamplesByStage) -> Iterator[str]:
    """Yield a fault for each field of a record that differs from that of its stage."""
    for stage, samples in stage_samples.items():
        fields = samples[key].fields if key in samples else {}
        for name, value in fields.items():
            if record.get(name, value) != value:
                yield f"{name} in its json is not what stage {stage} made for it"
