"""One shard of a finished dataset, looked at sample by sample; shards are looked at side by side."""

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
from stages.package.schema import schema_faults, validator_of
from stages.shape.collection.discovery import audits, languages
from stages.shape.collection.discovery import members as declared_members
from stages.shape.collection.packaged import PackagedSample
from stages.verification.files import ClassCounts, SampleRow
from stages.verification.findings import Findings
from stages.verification.samples import (
    SampleError,
    array_faults,
    read_packaged,
    read_record,
    record_faults,
    sample_faults,
)


def check_shard(
    folder: Path,
    shard: Mapping[str, Any],
    manifest: Mapping[str, Any],
    schema: str,
    index: Path | None,
    anew: Collection[int],
) -> tuple[Findings, list[SampleRow], ClassCounts]:
    """What is found in one whole shard of the dataset in `folder`, and what all its samples together are held against.

    shard: its entry in the manifest; schema: of the records, as JSON; index: the index, if it can be read; anew: the
    places of the samples that are held against what they were made from by other means, which takes long.
    """
    findings, rows, tally, path = Findings(), list[SampleRow](), ClassCounts(), str(shard["path"])
    places = DatasetPaths(folder.resolve().parent, folder.resolve().name)
    spoken = {name: each.rebuild(places) for name, each in languages().items()}
    validator = validator_of(schema)
    wanted = [each["name"] for each in manifest["members"]]
    made, indexed = _made(places, path), _indexed(index, path)
    try:
        for place, (key, offset, members) in enumerate(shard_samples(folder / path)):
            findings.look("samples")
            where = f"{path}: {key}"
            if list(members) != wanted:
                findings.fault("samples", where, f"has members {', '.join(members)}; not as the others")
                continue
            for what in _foreign(key, members, made):
                findings.fault("samples", where, what)
            row = (indexed or {}).pop(key, None)
            try:
                record = read_record(members["json"])
                for what in (
                    *record_faults(record, key, shard["split"], manifest["kits"]),
                    *schema_faults(validator, record),
                    *_altered(key, record, made),
                ):
                    findings.fault("samples", where, what)
                if indexed is not None:
                    findings.look("index")
                    for what in _misplaced(row, record, path, offset, tar_bytes(members)):
                        findings.fault("index", where, what)
                rows.append((key, path, str(record.get("split")), str(record.get("kit")), str(record.get("graph"))))
                tally.update(_classes_of(record, str(shard["split"])))
                sample = read_packaged(key, record, members, spoken, manifest["config"])
                if place in anew:
                    findings.look("geometry")
                for check, what in _faults(sample, manifest, places if place in anew else None):
                    findings.fault(check, where, what)
            except SampleError as error:
                findings.fault("samples", where, str(error))
            except LookupError as error:
                findings.skip(f"{error}: make the dataset here to look at its samples")
    except (tarfile.TarError, OSError, ValueError) as error:
        findings.fault("samples", path, f"cannot be read after {findings.checked.get('samples', 0)} samples: {error}")
    for key in indexed or ():
        findings.fault("index", f"{path}: {key}", "is in the index and not in the shard")
    count = findings.checked.get("samples", 0)
    if count != shard["samples"]:
        findings.fault("samples", path, f"has {count} samples, the manifest counts {shard['samples']}")
    return findings, rows, tally


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


def _faults(
    sample: PackagedSample, manifest: Mapping[str, Any], places: DatasetPaths | None
) -> Iterator[tuple[str, str]]:
    """The faults of a sample with the checks that find them; with `places` it is looked at by other means, too."""
    try:
        yield from (("samples", what) for what in array_faults(sample, manifest["members"]))
        yield from (("samples", what) for what in sample_faults(sample))
        if places is not None:
            for each in audits().values():
                yield from (("geometry", what) for what in each.recheck(sample, places))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        yield "samples", f"its json cannot be meant: {type(error).__name__}: {error}"


def _classes_of(record: Mapping[str, Any], split: str) -> ClassCounts:
    """How many parts of each class a record lists, and that it is one shape with them."""
    parts = record.get("parts")
    listed = [each["class"] for each in parts if isinstance(each, dict) and "class" in each] if parts else []
    counted = Counter({("parts", split, str(number)): count for number, count in Counter(map(str, listed)).items()})
    counted.update({("shapes", split, number): 1 for number in set(map(str, listed))})
    return counted


def _indexed(index: Path | None, path: str) -> dict[str, dict[str, Any]] | None:
    """The rows of the index for the samples of a shard, by key; None where they cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if index is None:
        return None
    try:
        return {row["key"]: row for row in pq.read_table(index, filters=[("shard", "==", path)]).to_pylist()}
    except (pa.ArrowException, OSError, KeyError):
        return {}


def _misplaced(
    found: Mapping[str, Any] | None, record: Mapping[str, Any], path: str, offset: int, size: int
) -> Iterator[str]:
    """What the index says otherwise of a sample."""
    if found is None:
        yield "is not where the index says, or not in it"
        return
    with suppress(KeyError, TypeError):  # a record without what the index needs is named where it is looked at
        wanted = index_row(record, path, offset, size)
        wrong = [name for name in wanted if found.get(name) != wanted[name]]
        if wrong:
            yield f"the index has another {', '.join(wrong)}"


@dataclass(frozen=True)
class Added:
    """What a stage has made for a sample: the digest of each member, and fields of the record."""

    digests: Mapping[str, bytes]
    fields: Mapping[str, Any]


def _made(places: DatasetPaths, path: str) -> dict[str, dict[str, Added]]:
    """What each stage has made for the samples of a shard, by key, where the mill's folder still has it."""
    name, _, number = Path(path).stem.rpartition("-")
    shard = f"{places.dataset}-{name.rpartition('-')[2]}-{number}"
    made: dict[str, dict[str, Added]] = {}
    for stage in declared_members():
        tar = places.stage(stage).root / f"{shard}.tar"
        with suppress(tarfile.TarError, OSError, ValueError):  # the mill's own check names what is damaged there
            if tar.is_file():
                made[stage] = {
                    key: Added(
                        {each: sha256(content).digest() for each, content in members.items() if each != "json"},
                        json.loads(members.get("json", b"{}")),
                    )
                    for key, members in read_shard(tar)
                }
    return made


def _foreign(key: str, members: Mapping[str, bytes], made: Mapping[str, Mapping[str, Added]]) -> Iterator[str]:
    """Members that are not those that a stage has made for this sample."""
    for stage, samples in made.items():
        if key not in samples:
            yield f"is no sample that stage {stage} knows"
            continue
        for name, digest in samples[key].digests.items():
            if name in members and sha256(members[name]).digest() != digest:
                yield f"{name} is not the one that stage {stage} has made for it"


def _altered(key: str, record: Mapping[str, Any], made: Mapping[str, Mapping[str, Added]]) -> Iterator[str]:
    """Fields of a record that are not those that a stage has made for its sample."""
    for stage, samples in made.items():
        fields = samples[key].fields if key in samples else {}
        for name, value in fields.items():
            if record.get(name, value) != value:
                yield f"{name} in its json is not what stage {stage} has made for it"
