#!/usr/bin/env python3
"""Verify the dataset in this folder. It needs Python 3.10, numpy and trimesh, and nothing of what made the dataset.

    python verify.py                       # all files and records, and the geometry of 100 samples
    python verify.py --samples all         # the geometry of all samples
    python verify.py FOLDER --samples 20 --workers 8

It derives from the files what can be derived, by code of its own: checksums, members, records, counts, splits, and from
the GLB of a sample its bounds, its parts and poses, points and normals, contacts, the outline of its drawings, its
hierarchy and symmetries, its union with signed distances and occupancy, and the sentences of its captions.
Each fault is printed with its file and sample. Exit code 0: no fault; 1: faults.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import re
import struct
import sys
import tarfile
import threading
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

POSE_TOLERANCE_SHARE = 1e-5
"""Largest difference of poses and bounds, as a share of the diagonal."""
POINT_TOLERANCE_SHARE = 1e-4
"""Largest distance of a point from its part, as a share of the diagonal."""
MIN_NORMAL_COSINE = 0.99
MAX_NOISE_DEVIATIONS = 4.0
"""The noise of scans is cut at this many standard deviations."""
POINTS_PER_SAMPLE = 128
"""Points whose place on the mesh is checked."""
PAIRS_PER_SAMPLE = 64
"""Pairs of parts whose contact is checked."""
VERTICES_PER_PAIR = 16
OUTLINE_PIXELS = 4.0
"""Largest distance of a drawing's outline from that of the mesh, besides the line width."""
INK_LEVEL = 128
FAULTS_SHOWN = 20
SECONDS_BETWEEN_LINES = 5.0
DISTINCT = ("key", "shape graph", "mesh")
"""What no two splits share; a key is there once."""
DISTANCES_PER_SAMPLE = 32
"""Signed distances that are compared with the union, and cells of the occupancy grid."""
DISTANCE_TOLERANCE_SHARE = 1e-5
"""Largest error of a signed distance, as a share of the side of the cube."""
VOLUME_TOLERANCE_SHARE = 1e-3
PUSH_TOLERANCE = 1e-5
"""Margins this near to the push of the config may be of stable shapes or of others, in weights."""
IMAGE_TOLERANCE_SHARE = 2e-3
"""Largest distance of the image of a part from the part that a symmetry names, as a share of the diagonal."""
CAPTION_SLACK_SHARE = 0.02
"""Lengths that differ by less than this share of the longest side are alike in captions."""
ABOUT_SHARE = 0.07
"""Relative difference that `about` may hide."""
COUNTERS = {"set", "sets", "pane", "panes", "flight", "flights"}
"""Words that count others in captions, such as `two panes of glass`."""
PLAIN_WORDS = {"revolution": ["turned", "solid"], "sweep": ["swept", "bar"]}
"""Words in captions for labels that name how a solid is made."""
IRREGULAR_SINGULARS = {
    "shelves": "shelf",
    "leaves": "leaf",
    "halves": "half",
    "feet": "foot",
    "acroteria": "acroterion",
}
NUMBER_WORDS = [
    *("zero", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
]
TIMES = {"one and a half times": 1.5, "twice": 2.0, "two and a half times": 2.5} | {
    f"{word} times": float(number) for number, word in enumerate(NUMBER_WORDS)
}
CONTACT_KINDS = {"point", "line", "face"}
GRAPH_LANGUAGE = "kit"
NOT_CHECKED = (
    "not checked: physical stability (only rootedness is), strings and programs, rendered images, files of exports, "
    "flags of surfaces, colors in captions, the Parquet index"
)
JSON_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "integer": (int,),
    "number": (int, float),
}


@dataclass
class DatasetFindings:
    """What was found in a shard, or in the whole dataset.

    faults: sentences, each with its file
    checked: numbers of things checked
    classes: numbers of shapes and parts, by field, class and split
    partial: kits whose shape graphs may leave out kinds of contact, so that parts touch without being in contacts.npy
    samples: of a shard: the sample that has a key, a shape graph or a mesh, by kind and digest
    split_of: of the dataset: the split where each was first seen
    """

    faults: list[str] = field(default_factory=list)
    checked: Counter[str] = field(default_factory=Counter)
    classes: Counter[tuple[str, int, str]] = field(default_factory=Counter)
    partial: set[str] = field(default_factory=set)
    samples: dict[str, dict[bytes, str]] = field(default_factory=lambda: {kind: {} for kind in DISTINCT})
    split_of: dict[str, dict[bytes, str]] = field(default_factory=lambda: {kind: {} for kind in DISTINCT})

    def note(self, kind: str, content: bytes, sample: str) -> None:
        """Note what a sample of a shard has."""
        digest = hashlib.blake2b(content, digest_size=16).digest()
        if kind == "key" and digest in self.samples[kind]:
            self.faults.append(f"{sample}: is there twice")
        self.samples[kind][digest] = sample

    def add(self, other: DatasetFindings, split: str) -> None:
        """Add the findings of a shard of a split."""
        self.faults += other.faults
        self.checked.update(other.checked)
        self.classes.update(other.classes)
        for kind, samples in other.samples.items():
            known = self.split_of[kind]
            for digest, sample in samples.items():
                if digest in known and (kind == "key" or known[digest] != split):
                    self.faults.append(f"{sample}: its {kind} is in {known[digest]} too")
                known.setdefault(digest, split)


def verify(folder: Path, samples: int | None = 100, seed: int = 0, workers: int = 1) -> DatasetFindings:
    """Return the findings of a dataset. samples: number of samples whose geometry is checked; None for all."""
    findings = DatasetFindings()
    listed = check_files(folder, findings)
    try:
        manifest = json.loads((folder / "manifest.json").read_bytes())
        class_rows = json.loads((folder / "classes.json").read_bytes())
        classes = {int(row["id"]): (row["name"], row["shapes"], row["parts"]) for row in class_rows}
        counts = [(str(shard["path"]), str(shard["split"]), int(shard["samples"])) for shard in manifest["shards"]]
        total, splits = int(manifest["samples"]), dict(manifest["splits"])
        members = [(str(member["name"]), str(member["dtype"]), list(member["shape"])) for member in manifest["members"]]
        schema = dict(json.loads((folder / "schema.json").read_bytes()))
        config = manifest["config"]
        nouns = dict(config.get("captions", {}).get("nouns", {}))
        push = float(config.get("validity", {}).get("push", "nan"))
        sharing = manifest.get("graphs_share_split")
        producers = sorted(sharing if isinstance(sharing, list) else manifest["producers"] if sharing else ())
        kits = config.get("exemplars", {}).get("kits", [])
        findings.partial = {str(kit["name"]) for kit in kits if set(kit["contact"]["kinds"]) != CONTACT_KINDS}
        owned = {(kit, number): row["id"] for row in class_rows for kit, number in row.get("own", {}).items()}
    except (OSError, ValueError, KeyError, TypeError) as error:
        findings.faults.append(f"manifest.json, classes.json or schema.json cannot be read: {error!r}")
        return findings
    count = total if samples is None else min(samples, total)
    chosen = np.sort(np.random.default_rng(seed).choice(total, count, replace=False))
    labels = {number: str(name) for number, (name, _, _) in classes.items()}
    jobs, first = [], 0
    for number, (path, split, size) in enumerate(counts):
        if path in listed:
            inside = chosen[slice(*np.searchsorted(chosen, (first, first + size)))]
            places = set((inside - first).tolist())
            job = ShardJob(
                *(folder, path, split, members, labels, owned, producers, places, (seed, number)),
                *(schema, nouns, push, findings.partial),
            )
            jobs.append(job)
        else:
            findings.faults.append(f"{path}: is in manifest.json and not in checksums.txt")
        first += size
    with ProcessPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        results = pool.map(check_shard, jobs) if pool else map(check_shard, jobs)
        for job, result in zip(jobs, results, strict=True):
            findings.add(result, job.split)
    for path, split, size in counts:
        if findings.checked.pop(path, 0) != size:
            findings.faults.append(f"{path}: does not have the {size} samples that manifest.json counts in {split}")
    if sum(splits.values()) != total or total != sum(size for _, _, size in counts):
        findings.faults.append(f"manifest.json: its splits and shards do not add up to {total} samples")
    for number, (name, shapes, parts) in classes.items():
        for kind, stated in (("shapes", shapes), ("parts", parts)):
            for split, expected in stated.items():
                if findings.classes[kind, number, split] != expected:
                    actual = findings.classes[kind, number, split]
                    findings.faults.append(f"classes.json: {name}: {expected} {kind} in {split}; there are {actual}")
    return findings


def check_files(folder: Path, findings: DatasetFindings) -> set[str]:
    """Compare every file with checksums.txt; return the files inside the folder that it lists."""
    try:
        lines = (folder / "checksums.txt").read_text(encoding="utf-8").splitlines()
        digests = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    except (OSError, ValueError) as error:
        findings.faults.append(f"checksums.txt cannot be read: {error}")
        return set()
    inside = set()
    for name, digest in digests.items():
        path = folder / name
        if not path.is_file() or folder.resolve() not in path.resolve().parents:
            findings.faults.append(f"{name}: is missing")
            continue
        inside.add(name)
        if file_digest(path) != digest:
            findings.faults.append(f"{name}: is corrupted: its sha256 is not that of checksums.txt")
        findings.checked["files"] += 1
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        empty = path.is_dir() and not any(path.iterdir())
        if empty or path.is_symlink() or (path.is_file() and name not in {*digests, "checksums.txt"}):
            findings.faults.append(f"{name}: does not belong to the dataset")
    return inside


@dataclass(frozen=True)
class ShardJob:
    """A shard to check.

    members: name, dtype and shape of each member
    labels: name of each class
    owned: class of each label of each kit, by the kit and the label's number there, where a dataset joins producers
    sharing: producers whose samples of one kit and graph share a split
    places: samples whose geometry is checked, by their place in the shard
    schema: JSON schema of the records
    nouns: what captions call the shapes of a kit, where the config states it
    push: what a stable shape bears, in weights; nan if it is not stated
    partial: see `DatasetFindings`
    """

    folder: Path
    path: str
    split: str
    members: list[tuple[str, str, list[Any]]]
    labels: dict[int, str]
    owned: dict[tuple[str, int], int]
    sharing: list[str]
    places: set[int]
    seed: tuple[int, int]
    schema: dict[str, Any] = field(default_factory=dict)
    nouns: dict[str, str] = field(default_factory=dict)
    push: float = float("nan")
    partial: set[str] = field(default_factory=set)


def check_shard(job: ShardJob) -> DatasetFindings:
    """Return the findings of a shard, whatever its files hold."""
    findings = DatasetFindings()
    rng = np.random.default_rng(job.seed)
    before: dict[str, Any] = {}
    for place, (key, members) in enumerate(read_shard(job.folder / job.path, job.path, findings)):
        try:
            for text in sample_faults(job, key, members, findings, rng if place in job.places else None):
                findings.faults.append(f"{job.path}: {key}: {text}")
            record = json.loads(members["json"])
            findings.faults += (f"{job.path}: {key}: {text}" for text in contrast_faults(before, record))
            before = record
        except Exception as error:
            findings.faults.append(f"{job.path}: {key}: cannot be read: {type(error).__name__}: {error}")
        findings.checked.update(["samples", job.path])
    findings.faults += (f"{job.path}: {text}" for text in contrast_faults(before, {}))
    return findings


def contrast_faults(before: dict[str, Any], record: dict[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the pair that a sample makes with the one before it, or that either lacks.

    before: record of the sample before; {} for the first
    record: record of the sample; {} after the last
    """
    first, second = (of.get("lineage", {}).get("contrast", {"role": "alone"}) for of in (before, record))
    if (first["role"] == "stands") != (second["role"] == "falls"):
        yield f"{before.get('key', 'nothing')} and {record.get('key', 'nothing')}: one is in a pair without the other"
    if second["role"] != "falls" or first["role"] != "stands":
        return
    if (first["partner"], second["partner"]) != (record["key"], before["key"]):
        yield "it and the sample before it do not name each other as partners"
    if any(first[fact] != second[fact] for fact in ("edit", "part_name", "cause")):
        yield "its partner names another edit or cause"
    if before["physics"]["falls"] or not record["physics"]["falls"]:
        yield "of it and its partner, not exactly the edited one falls"
    if (second["cause"] == "unsupported") == record["physics"]["rooted"]:
        yield f"it falls because it is {second['cause']}; rooted: {record['physics']['rooted']}"
    if second["gives_way"] != record["physics"]["fallen"]:
        yield f"part {second['gives_way']} gives way, and part {record['physics']['fallen']} is the first to fall"
    poses, edited = ({part["name"]: np.array(part["pose"]) for part in of["parts"]} for of in (before, record))
    name = second["part_name"]
    places = [list(of).index(name) if name in of else -1 for of in (poses, edited)]
    if places != [first["part"], second["part"]] or places[0] < 0:
        yield f"{name} is not the edited part that it and its partner name"
        return
    ways = [of["parts"][facts["gives_way"]]["name"] for of, facts in ((before, first), (record, second))]
    if ways[0] != ways[1]:
        yield f"{ways[1]} gives way, and in its partner {ways[0]}"
    others = [{part: pose for part, pose in of.items() if part != name} for of in (poses, edited)]
    if list(others[0]) != list(others[1]) or any((others[0][part] != others[1][part]).any() for part in others[0]):
        yield f"it differs from its partner in more than {name}"
    if second["edit"] == "removed":
        is_so = name not in edited
    else:
        change = edited[name] @ np.linalg.inv(poses[name]) if name in edited else np.eye(4)
        is_turned = np.abs(change[:3, :3] - np.eye(3)).max() > 1e-6
        is_so = name in edited and is_turned == (second["edit"] == "shortened") and np.abs(change - np.eye(4)).max() > 0
    if not is_so:
        yield f"{name} is not {second['edit']}"


def read_shard(path: Path, name: str, findings: DatasetFindings) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield key and members of each sample of a shard."""
    key, members = "", dict[str, bytes]()
    try:
        with tarfile.open(path) as tar:
            for entry in tar:
                entry_key, _, member = entry.name.partition(".")
                stream = tar.extractfile(entry)
                if entry_key != key:
                    if members:
                        yield key, members
                    key, members = entry_key, {}
                if stream is None or member in members:
                    findings.faults.append(f"{name}: {entry.name}: is no plain file, or is there twice")
                else:
                    members[member] = stream.read()
    except (OSError, tarfile.TarError) as error:
        findings.faults.append(f"{name}: cannot be read: {error}")
    if members:
        yield key, members


def sample_faults(
    job: ShardJob, key: str, members: dict[str, bytes], findings: DatasetFindings, rng: np.random.Generator | None
) -> Iterator[str]:
    """Yield what is wrong with a sample. rng: chooses points and pairs; without it the geometry is not checked."""
    declared = {name for name, _, _ in job.members}
    if {*declared, "json"} != {*members, "json"}:
        yield f"has the members {sorted(members)}, manifest.json lists {sorted(declared)}"
    record = json.loads(members["json"])
    if record["key"] != key or record["split"] != job.split:
        yield f"its record is of {record['key']} in {record['split']}, the shard is of {job.split}"
    if has_empty_value(record):
        yield "its json holds a null or an empty value"
    for text in schema_faults(job.schema, record, "its json"):
        yield f"{text}, which schema.json does not allow"
        break
    arrays = {}
    for name, dtype, shape in job.members:
        if name.endswith(".npy") and name in members:
            array = arrays[name] = np.load(io.BytesIO(members[name]), allow_pickle=False)
            sizes = zip(array.shape, shape, strict=False)
            right = array.ndim == len(shape) and all(size == given for size, given in sizes if isinstance(given, int))
            if array.dtype != dtype or not right:
                yield f"{name} is {array.dtype} {array.shape}, not {dtype} {shape}"
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                yield f"{name} holds values that are not finite"
    yield from record_faults(job, record, members, arrays, findings)
    for cloud in clouds(arrays):
        yield from label_faults(record, cloud)
    if rng is not None and "glb" in members:
        yield from geometry_faults(job, record, members, arrays, rng)
        findings.checked["samples with geometry"] += 1


def has_empty_value(value: Any) -> bool:
    """Return whether JSON holds a null, or an empty list, object or text."""
    if isinstance(value, dict | list):
        return not value or any(map(has_empty_value, value.values() if isinstance(value, dict) else value))
    return value is None or value == ""


def schema_faults(schema: dict[str, Any], value: Any, place: str) -> Iterator[str]:
    """Yield where JSON is not as a schema says, by the keywords that schemas of datasets use."""
    kind = schema.get("type")
    is_truth = isinstance(value, bool) and kind in ("integer", "number")
    if kind is not None and (is_truth or not isinstance(value, JSON_TYPES[kind])):
        yield f"{place} is no {kind}"
        return
    if value not in schema.get("enum", [schema.get("const", value)]):
        yield f"{place} is {value!r}"
    if isinstance(value, dict):
        known = schema.get("properties", {})
        if not {*schema.get("required", ())} <= {*value} or (
            schema.get("additionalProperties") is False and not {*value} <= {*known}
        ):
            yield f"{place} has the fields {', '.join(value)}"
        for name in known.keys() & value.keys():
            yield from schema_faults(known[name], value[name], f"{place}: {name}")
    elif isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            yield f"{place} has {len(value)} items"
        for number, item in enumerate(value):
            yield from schema_faults(schema.get("items", {}), item, f"{place}: {number}")
    elif isinstance(value, str):
        if len(value) < schema.get("minLength", 0) or not re.search(schema.get("pattern", ""), value):
            yield f"{place} is {value!r}"
    elif isinstance(value, int | float):
        above, below = schema.get("exclusiveMinimum", -np.inf), schema.get("exclusiveMaximum", np.inf)
        if not (above < value < below and schema.get("minimum", value) <= value <= schema.get("maximum", value)):
            yield f"{place} is {value}"


def record_faults(
    job: ShardJob,
    record: dict[str, Any],
    members: dict[str, bytes],
    arrays: dict[str, np.ndarray],
    findings: DatasetFindings,
) -> Iterator[str]:
    """Yield what is wrong with parts, counts, text and joints, and note classes, graph and mesh."""
    parts, counts, sample = record["parts"], record["counts"], f"{job.path}: {record['key']}"
    names = [part["name"] for part in parts]
    if len(set(names)) != len(parts) or [part["instance"] for part in parts] != list(range(len(parts))):
        yield "names or numbers of its parts are not distinct"
    for part in parts:
        if job.labels.get(part["class"]) != part["label"]:
            yield f"{part['name']}: class {part['class']} is not {part['label']} in classes.json"
        if job.owned and job.owned.get((record["kit"], part["own_class"])) != part["class"]:
            yield f"{part['name']}: class {part['own_class']} of {record['kit']} is not {part['class']} in classes.json"
    findings.classes.update(("parts", part["class"], job.split) for part in parts)
    findings.classes.update({("shapes", part["class"], job.split) for part in parts})
    if (counts["parts"], counts["types"]) != (len(parts), len({part["label"] for part in parts})):
        yield f"counts {counts['parts']} parts and {counts['types']} types; its list of parts differs"
    if "contacts.npy" in arrays:
        contacts = arrays["contacts.npy"]
        yield from pair_faults("contacts.npy", contacts, len(parts))
        pieces = component_count(len(parts), contacts)
        expected = (contacts.shape[1], pieces, contacts.shape[1] - len(parts) + pieces)
        stated = (counts["contacts"], counts["pieces"], counts["cycles"])
        if expected != stated:
            yield f"counts {stated} contacts, pieces and cycles; contacts.npy makes {expected}"
    if "joints.npy" in arrays:
        yield from pair_faults("joints.npy", arrays["joints.npy"], len(parts))
        components = component_count(len(parts), arrays["joints.npy"])
        physics = record["physics"]
        if physics["components"] != components:
            yield f"counts {physics['components']} components; joints.npy makes {components}"
        bears = physics["margin"] - job.push
        if abs(bears) > PUSH_TOLERANCE and physics["stable"] != (bears > 0):
            yield f"is called stable: {physics['stable']}, and bears {physics['margin']} of its weight as a push"
    if "txt" in members and not members["txt"].decode().startswith(record["text"]):
        yield "its text is not that of the record"
    findings.note("key", record["key"].encode(), sample)
    if record["producer"] in job.sharing:
        findings.note("shape graph", f"{record['kit']} {record['graph']}".encode(), sample)
    if "glb" in members:
        findings.note("mesh", members["glb"], sample)


@dataclass(frozen=True)
class Cloud:
    """A point cloud of a sample. name: of the member with its points; scan: its number, -1 for a whole cloud"""

    name: str
    scan: int
    points: np.ndarray
    normals: np.ndarray
    labels: np.ndarray
    instances: np.ndarray


def clouds(arrays: dict[str, np.ndarray]) -> Iterator[Cloud]:
    """Yield the clouds and scans of a sample: `points.npy`, `points1.npy`, `scan_points0.npy` and so on."""
    for name in arrays:
        found = re.fullmatch(r"(scan_)?points(\d*)\.npy", name)
        if found:
            prefix, number = found[1] or "", found[2]
            columns = (f"{prefix}{kind}{number}.npy" for kind in ("points", "normals", "labels", "instances"))
            yield Cloud(name, int(number) if prefix else -1, *(arrays[column] for column in columns))


def label_faults(record: dict[str, Any], cloud: Cloud) -> Iterator[str]:
    """Yield what is wrong with labels, instances and normals of points."""
    instances, classes = cloud.instances, np.array([part["class"] for part in record["parts"]])
    if instances.size and not 0 <= instances.min() <= instances.max() < len(classes):
        yield f"the instances of {cloud.name} name a part that the record does not have"
    elif not np.array_equal(classes[instances], cloud.labels):
        yield f"the labels of {cloud.name} are not the classes of the parts of its instances"
    elif cloud.scan < 0 and "min_per_part" in record["points"] and record["points"]["surface"] == "all":
        counts = np.bincount(instances[record["points"]["farthest"] :], minlength=len(classes))
        if counts.min() < record["points"]["min_per_part"]:
            yield f"{cloud.name} has {counts.min()} points on a part, fewer than its json says"
    if np.abs(np.linalg.norm(cloud.normals, axis=1) - 1).max(initial=0) > 1e-3:
        yield f"the normals of {cloud.name} are no unit vectors"


def geometry_faults(
    job: ShardJob,
    record: dict[str, Any],
    members: dict[str, bytes],
    arrays: dict[str, np.ndarray],
    rng: np.random.Generator,
) -> Iterator[str]:
    """Yield what the mesh says against record, points, contacts and drawings."""
    scene: Any = trimesh.load_scene(io.BytesIO(members["glb"]), file_type="glb", process=False)
    extras = glb_extras(members["glb"])
    triangles: list[np.ndarray] = []
    low, high = np.array(record["bounds"][0]), np.array(record["bounds"][1])
    diagonal = float(np.linalg.norm(high - low))
    for part in record["parts"]:
        name = part["name"]
        if name not in extras:
            yield f"{name}: is no node of the GLB"
            return
        if any(extras[name].get(fact) != part[fact] for fact in ("class", "instance")):
            yield f"{name}: the GLB says {extras[name]}, the record class {part['class']}"
        matrix, geometry = scene.graph.get(name)
        # trimesh makes the primitives of a part with several materials nodes below its node
        below = scene.graph.transforms.children.get(name, []) if geometry is None else [name]
        primitives = [scene.geometry[scene.graph.get(node)[1]].triangles for node in below]
        if "pose" in part and not is_placed_by(matrix, np.array(part["pose"]), POSE_TOLERANCE_SHARE * max(diagonal, 1)):
            yield f"{name}: its pose in the GLB is not that of the record"
        triangles.append(np.concatenate(primitives) @ matrix[:3, :3].T + matrix[:3, 3])
    if len(extras) != len(record["parts"]):
        yield f"the GLB has {len(extras)} parts, the record {len(record['parts'])}"
    corners = np.concatenate(triangles).reshape(-1, 3)
    gap = max(np.abs(corners.min(axis=0) - low).max(), np.abs(corners.max(axis=0) - high).max())
    if gap > POSE_TOLERANCE_SHARE * diagonal:
        yield f"its bounds differ from those of the GLB by {gap:.3g}"
    for cloud in clouds(arrays):
        yield from point_faults(record, triangles, cloud, POINT_TOLERANCE_SHARE * diagonal, rng)
    if "contacts.npy" in arrays:
        tolerance = max(float(record["contact_tolerance"]), 1e-6 * diagonal)
        names = [part["name"] for part in record["parts"]]
        # Only the contacts of shape graphs are of some kinds; those of texts are all that are near enough.
        is_partial = record["language"] == GRAPH_LANGUAGE and record["kit"] in job.partial
        near_pairs = 0 if is_partial else PAIRS_PER_SAMPLE
        yield from contact_faults(names, triangles, arrays["contacts.npy"], tolerance, near_pairs, rng)
    if "joints.npy" in arrays:
        yield from rooted_faults(record, triangles, arrays["joints.npy"], diagonal)
    for index, camera in enumerate(record.get("sketches", ())):
        yield from drawing_faults(
            f"sketch{index}.png", members[f"sketch{index}.png"], camera, np.concatenate(triangles)
        )
    if "hierarchy" in record:
        yield from hierarchy_faults(record, scene)
    if "symmetry" in record:
        yield from symmetry_faults(record, triangles, IMAGE_TOLERANCE_SHARE * diagonal)
    if "union_faces.npy" in arrays:
        yield from union_faults(record, arrays, triangles, rng)
    if "caption.json" in members:
        boxes = np.array([[part.reshape(-1, 3).min(axis=0), part.reshape(-1, 3).max(axis=0)] for part in triangles])
        captions = json.loads(members["caption.json"])
        yield from caption_faults(captions, CaptionFacts(record, boxes, arrays["contacts.npy"], job.nouns))


def is_placed_by(matrix: np.ndarray, pose: np.ndarray, tolerance: float) -> bool:
    """Return whether a node's matrix is a record's pose, up to a stretch, which the GLB has in the mesh of the part.

    A stretch is a symmetric positive map before the matrix, which is rigid.
    """
    if np.abs(matrix - pose).max() <= tolerance:
        return True
    stretch = np.linalg.inv(matrix)[:3, :3] @ pose[:3, :3]
    is_symmetric = np.abs(stretch - stretch.T).max() <= POSE_TOLERANCE_SHARE
    is_stretch = is_symmetric and np.linalg.eigvalsh(stretch).min() > POSE_TOLERANCE_SHARE
    return bool(is_stretch and np.abs(matrix[:3, 3] - pose[:3, 3]).max() <= tolerance)


def point_faults(
    record: dict[str, Any],
    triangles: list[np.ndarray],
    cloud: Cloud,
    tolerance: float,
    rng: np.random.Generator,
) -> Iterator[str]:
    """Yield points outside the bounds, and what is wrong with a random choice of points."""
    made = record["points"]
    points = cloud.points.astype(np.float64) / made["scale"] + np.array(made["centre"])
    instances, normals = cloud.instances, cloud.normals
    if cloud.scan >= 0:
        tolerance += MAX_NOISE_DEVIATIONS * record["scans"][cloud.scan]["depth_noise"]
    low, high = np.array(record["bounds"])
    if (points < low - tolerance).any() or (points > high + tolerance).any():
        yield f"{cloud.name} has points outside its bounds"
    chosen = rng.permutation(len(points))[:POINTS_PER_SAMPLE]
    near, of_point = near_triangles([triangles[part] for part in instances[chosen]], points[chosen], tolerance)
    across = np.cross(near[:, 1] - near[:, 0], near[:, 2] - near[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    products = (across * normals[chosen][of_point]).sum(axis=1)
    has_area, is_right = lengths > 0, products >= MIN_NORMAL_COSINE * lengths
    all_near, with_area, right = (
        np.isin(np.arange(len(chosen)), of_point[mask]) for mask in (lengths >= 0, has_area, has_area & is_right)
    )
    for place, index in enumerate(chosen.tolist()):
        if not all_near[place]:
            yield f"point {index} of {cloud.name} does not lie on its part"
            return
        if with_area[place] and not right[place]:
            yield f"the normal of point {index} of {cloud.name} is not that of its face"
            return


def contact_faults(
    names: list[str],
    triangles: list[np.ndarray],
    contacts: np.ndarray,
    tolerance: float,
    near_pairs: int,
    rng: np.random.Generator,
) -> Iterator[str]:
    """Yield contacts of parts that are apart, and pairs that touch at a vertex and are no contact.

    near_pairs: number of pairs that are near each other, are no contacts and are looked at
    """
    boxes = [(part.reshape(-1, 3).min(axis=0), part.reshape(-1, 3).max(axis=0)) for part in triangles]

    def apart(first: int, second: int) -> bool:
        (low, high), (other_low, other_high) = boxes[first], boxes[second]
        return bool((low - other_high > tolerance).any() or (other_low - high > tolerance).any())

    listed = {(first, second) for first, second in contacts.T.tolist()}
    for first, second in sorted(listed):
        if apart(first, second):
            yield f"{names[first]} and {names[second]} are in contacts.npy, and are apart"
    near = [pair for pair in combinations(range(len(triangles)), 2) if pair not in listed and not apart(*pair)]
    for place in rng.permutation(len(near))[:near_pairs].tolist():
        for first, second in (near[place], near[place][::-1]):
            vertices = np.unique(triangles[first].reshape(-1, 3), axis=0)
            low, high = boxes[second]
            inside = vertices[((vertices >= low - tolerance) & (vertices <= high + tolerance)).all(axis=1)]
            looked_at = inside[rng.permutation(len(inside))[:VERTICES_PER_PAIR]]
            if len(near_triangles([triangles[second]] * len(looked_at), looked_at, 0.5 * tolerance)[0]):
                yield f"{names[first]} and {names[second]} touch, and are not in contacts.npy"
                return


def near_triangles(surfaces: list[np.ndarray], points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles (m, 3, 3) that are at most `tolerance` from a point of their own, and the point's index.

    surfaces: triangles (n, 3, 3) that are compared with each point
    points: (k, 3)
    """
    distinct = {id(surface): surface for surface in surfaces}
    boxes = {key: (surface.min(axis=1), surface.max(axis=1)) for key, surface in distinct.items()}
    found, counts = [np.empty((0, 3, 3))], list[int]()
    for surface, point in zip(surfaces, points, strict=True):
        low, high = boxes[id(surface)]
        found.append(surface[((low <= point + tolerance) & (high >= point - tolerance)).all(axis=1)])
        counts.append(len(found[-1]))
    near, of_point = np.concatenate(found), np.repeat(np.arange(len(points)), np.array(counts, np.intp))
    if not len(near):
        return near, of_point
    gaps = trimesh.triangles.closest_point(near, points[of_point]) - points[of_point]
    is_near = np.linalg.norm(gaps, axis=1) <= tolerance
    return near[is_near], of_point[is_near]


def hierarchy_faults(record: dict[str, Any], scene: Any) -> Iterator[str]:
    """Yield groups without a place in the tree, and parts whose node in the GLB is not below that of their group."""
    groups, group_of = record["hierarchy"]["groups"], record["hierarchy"]["part_groups"]
    parents = [group["parent"] for group in groups]
    if parents[0] != -1 or any(not 0 <= parent < place for place, parent in enumerate(parents) if place):
        yield "its hierarchy is no tree with parents first"
    if len(group_of) != len(record["parts"]) or not all(0 <= group < len(groups) for group in group_of):
        yield "its hierarchy does not have each part in one group"
        return
    if len(groups) < 2:
        return
    nodes = [f"group {number} {group['name']}" for number, group in enumerate(groups)]
    above = dict(scene.graph.transforms.parents)
    expected = {part["name"]: nodes[group] for part, group in zip(record["parts"], group_of, strict=True)}
    expected |= {nodes[place]: nodes[parent] for place, parent in enumerate(parents) if place}
    for name, node in expected.items():
        if above.get(name) != node:
            yield f"{name} is below {above.get(name)} in the GLB, and in its hierarchy below {node}"
            return


def symmetry_faults(record: dict[str, Any], triangles: list[np.ndarray], tolerance: float) -> Iterator[str]:
    """Yield symmetries that do not take the vertices of a part to those of its image, and orbits that they leave."""
    symmetry, labels = record["symmetry"], [part["label"] for part in record["parts"]]
    orbits, (x, z) = symmetry["orbits"], symmetry["axis"]
    if len(orbits) != len(labels):
        yield "its symmetry does not have each part in one orbit"
        return
    vertices = [np.unique(part.reshape(-1, 3), axis=0) - (x, 0, z) for part in triangles]
    joined = []
    for operation in symmetry["operations"]:
        images = operation["images"]
        name = f"its {operation['kind']} by {operation['degrees']:g} degrees"
        if sorted(images) != list(range(len(labels))):
            yield f"{name} does not exchange its parts"
            return
        angle = np.radians(operation["degrees"])
        cosine, sine = np.cos(angle), np.sin(angle)
        if operation["kind"] == "mirror":
            normal = np.array([cosine, 0.0, -sine])
            matrix = np.eye(3) - 2 * np.outer(normal, normal)
        else:
            matrix = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
        for part, image in enumerate(images):
            moved, there = vertices[part] @ matrix.T, vertices[image]
            gaps = [abs(moved.min(axis=0) - there.min(axis=0)).max(), abs(moved.max(axis=0) - there.max(axis=0)).max()]
            if labels[part] != labels[image] or max(gaps) > tolerance:
                yield f"{name} does not take {record['parts'][part]['name']} to {record['parts'][image]['name']}"
                return
        joined += [(part, image) for part, image in enumerate(images)]
    together = component_of(len(labels), np.array(joined).T)
    if len({*zip(together.tolist(), orbits, strict=True)}) != len({*together.tolist()}) or len({*orbits}) != len(
        {*together.tolist()}
    ):
        yield "its orbits are not those of its symmetries"


def union_faults(
    record: dict[str, Any], arrays: dict[str, np.ndarray], triangles: list[np.ndarray], rng: np.random.Generator
) -> Iterator[str]:
    """Yield what is wrong with the union, and signed distances and cells that contradict it."""
    facts, faces = record["union"], arrays["union_faces.npy"].astype(np.int64)
    vertices = arrays["union_vertices.npy"].astype(np.float64)
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        yield "its union has faces of vertices that do not exist"
        return
    instances = arrays["union_instances.npy"]
    if len(instances) != len(faces) or instances.min() < 0 or instances.max() >= len(triangles):
        yield "its union has faces of parts that do not exist"
        return
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if not np.array_equal(np.sort(starts * len(vertices) + ends), np.sort(ends * len(vertices) + starts)):
        yield "its union is not watertight"
    corners = vertices[faces]
    low, side = np.array(facts["cube_low"]), float(facts["cube_side"])
    middles = corners.mean(axis=1)
    chosen = rng.permutation(len(faces))[:DISTANCES_PER_SAMPLE]
    named = [triangles[part] for part in instances[chosen]]
    is_near = np.isin(np.arange(len(chosen)), near_triangles(named, middles[chosen], POINT_TOLERANCE_SHARE * side)[1])
    for face in chosen[~is_near][:1].tolist():
        yield f"face {face} of its union is not on the part that it names"
        return
    if (middles < low - 1e-6 * side).any() or (middles > low + (1 + 1e-6) * side).any():
        yield "its union is not inside its cube"
    inner = corners - low
    volume = float(np.einsum("fi,fi->", inner[:, 0], np.cross(inner[:, 1], inner[:, 2])) / 6)
    if abs(volume - facts["volume"]) > VOLUME_TOLERANCE_SHARE * max(facts["volume"], 1e-3 * side**3):
        yield f"its union encloses {volume:.6g}, its json says {facts['volume']}"
    if "sdf_points.npy" in arrays:
        points, values = arrays["sdf_points.npy"].astype(np.float64), arrays["sdf_values.npy"].astype(np.float64)
        for index in rng.permutation(len(points))[:DISTANCES_PER_SAMPLE].tolist():
            distance = surface_distance(corners, points[index])
            if abs(distance - abs(values[index])) > DISTANCE_TOLERANCE_SHARE * side:
                yield f"signed distance {index} is {values[index]:.6g}, and its union {distance:.6g} away"
                return
            if distance > DISTANCE_TOLERANCE_SHARE * side and is_inside(corners, points[index]) != (values[index] < 0):
                yield f"the sign of signed distance {index} is not that of its union"
                return
    if "occupancy.npy" in arrays:
        filled = np.unpackbits(arrays["occupancy.npy"], axis=2)
        cell = side / len(filled)
        if abs(float(filled.sum()) * cell**3 - facts["volume"]) > cell * facts["area"]:
            yield f"its occupancy fills {float(filled.sum()) * cell**3:.6g}, its union {facts['volume']}"
        for place in rng.integers(0, len(filled), (DISTANCES_PER_SAMPLE, 3)):
            middle = low + (place + 0.5) * cell
            if is_inside(corners, middle) != filled[tuple(place)] and surface_distance(corners, middle) > 1e-3 * cell:
                yield f"cell {place.tolist()} of its occupancy is not as its union"
                return


def surface_distance(corners: np.ndarray, point: np.ndarray) -> float:
    """Return the distance of a point to the nearest of some triangles (n, 3, 3)."""
    apart = np.maximum(np.maximum(corners.min(axis=1) - point, point - corners.max(axis=1)), 0)
    limit = np.linalg.norm(corners[:, 0] - point, axis=1).min()
    near = corners[np.linalg.norm(apart, axis=1) <= limit]
    with np.errstate(divide="ignore", invalid="ignore"):
        closest = trimesh.triangles.closest_point(near, np.repeat(point[None], len(near), axis=0))
    return float(np.nanmin(np.linalg.norm(closest - point, axis=1)))


def is_inside(corners: np.ndarray, point: np.ndarray) -> bool:
    """Return whether a closed surface of triangles (n, 3, 3) is all around a point, by its solid angle."""
    away = corners - point
    lengths = np.linalg.norm(away, axis=2, keepdims=True)
    a, b, c = (away / np.maximum(lengths, 1e-300)).transpose(1, 0, 2)
    across = np.einsum("ni,ni->n", a, np.cross(b, c))
    along = 1 + np.einsum("ni,ni->n", a, b) + np.einsum("ni,ni->n", b, c) + np.einsum("ni,ni->n", c, a)
    return bool(2 * np.arctan2(across, along).sum() > 2 * np.pi)


@dataclass(frozen=True)
class CaptionFacts:
    """What captions are compared with.

    boxes: of the parts, float64 (n, 2, 3)
    contacts: pairs of parts that touch, (2, m)
    nouns: what shapes are called, by kit, where it is another name
    """

    record: dict[str, Any]
    boxes: np.ndarray
    contacts: np.ndarray
    nouns: dict[str, str]

    def side(self, word: str) -> float:
        """Return how tall, wide or long the shape is."""
        x, y, z = (self.boxes[:, 1].max(axis=0) - self.boxes[:, 0].min(axis=0)).tolist()
        return float({"tall": y, "wide": x, "long": max(x, z)}[word])

    @property
    def slack(self) -> float:
        """Length that makes no difference."""
        return CAPTION_SLACK_SHARE * max(map(self.side, ("tall", "long", "wide")))

    def parts(self, number: str | None, noun: str) -> list[int]:
        """Return the parts that a noun names, whose label has its words; none if their number is another.

        number: words or digits, and None for one
        """
        count = number_of(number or "a")
        found = self.alike(noun, is_plural=count != 1)
        return found if len(found) == count else []

    def alike(self, noun: str, is_plural: bool = False) -> list[int]:
        """Return the parts that a noun in singular or plural names."""
        *first, last = noun.split()
        if first and first[0] in COUNTERS:
            first = first[2:]
        elif is_plural:
            singulars = {IRREGULAR_SINGULARS.get(last), last.removesuffix("s"), last.removesuffix("es")} - {None, last}
            singulars |= {f"{last[:-3]}y"} if last.endswith("ies") else set()
            wanted = [sorted([*first, str(form)]) for form in singulars]
            return [place for place in range(len(self.boxes)) if any(words in wanted for words in self._words(place))]
        return [place for place in range(len(self.boxes)) if sorted([*first, last]) in self._words(place)]

    def _words(self, part: int) -> list[list[str]]:
        """Return the words of the last step of a part's label, and those of its last two steps."""
        steps = [label_words(step) for step in self.record["parts"][part]["label"].split("/")[-2:]]
        return [sorted(steps[-1]), sorted(word for step in steps for word in step)]

    def middles(self, parts: list[int]) -> np.ndarray:
        """Return the middles of the boxes of parts, float64 (n, 3)."""
        middles: np.ndarray = self.boxes[parts].mean(axis=1)
        return middles

    def in_columns(self, columns: str, rows: str, parts: list[int]) -> bool:
        """Return whether parts have as many heights as there are rows, each in every column."""
        if not parts or len(parts) != number_of(columns) * number_of(rows):
            return False
        heights = np.sort(self.middles(parts)[:, 1]).reshape(-1, number_of(columns))
        return bool(np.ptp(heights, axis=1).max() < self.slack and (np.diff(heights[:, 0]) > self.slack / 4).all())

    def in_stack(self, parts: list[int]) -> bool:
        """Return whether parts are one above the other."""
        boxes = self.boxes[parts]
        boxes = boxes[np.argsort(boxes[:, 0, 1])]
        return bool(parts and (boxes[1:, 0, 1] > boxes[:-1, 1, 1] - self.slack).all())

    def in_row(self, parts: list[int]) -> bool:
        """Return whether parts are on a line at equal steps."""
        if len(parts) < 2:
            return False
        middles = self.middles(parts)
        ends = max(combinations(middles, 2), key=lambda pair: float(np.linalg.norm(pair[0] - pair[1])))
        order = np.argsort((middles - ends[0]) @ (ends[1] - ends[0]))
        return bool(np.abs(middles[order] - np.linspace(*ends, len(middles))).max() < self.slack)

    def in_circle(self, parts: list[int]) -> bool:
        """Return whether parts are equally far from their middle, at one height."""
        if not parts:
            return False
        away = self.middles(parts)
        away = away - away.mean(axis=0)
        return bool(max(np.ptp(np.linalg.norm(away, axis=1)), np.ptp(away[:, 1])) < self.slack)

    def stands_on(self, parts: list[int]) -> bool:
        """Return whether some parts are those on the ground."""
        low = self.boxes[:, 0, 1]
        return (
            bool(self.record["physics"]["stable"])
            and parts == np.flatnonzero(low < low.min() + self.slack / 2).tolist()
        )

    def is_above(self, parts: list[int], others: list[int]) -> bool:
        """Return whether all of some parts are above all of others."""
        if not parts or not others:
            return False
        return bool(self.boxes[parts, 0, 1].min() > self.boxes[others, 1, 1].max() - self.slack)

    def all_touch(self, parts: list[int], others: list[int]) -> bool:
        """Return whether each of some parts touches one of others."""
        pairs = {(first, second) for pair in self.contacts.T.tolist() for first, second in (pair, pair[::-1])}
        return bool(parts) and all(any((part, other) in pairs for other in others) for part in parts)

    def is_called(self, noun: str) -> bool:
        """Return whether the shape is called so: as the config says, by its kit, or by the first step of its labels."""
        kit, labels = self.record["kit"], [part["label"].partition("/") for part in self.record["parts"]]
        if kit in self.nouns:
            return noun == self.nouns[kit]
        roots = {root for root, _, _ in labels}
        words = label_words(roots.pop() if len(roots) == 1 and all(slash for _, slash, _ in labels) else kit)
        return sorted(noun.split()) == sorted(words) or (noun == "shape" and (not words or words[-1].endswith("s")))

    def opens(self, adjective: str | None, noun: str, things: str | None) -> bool:
        """Return whether the first sentence of a caption holds."""
        if not self.is_called(noun):
            return False
        tall, wide, long = map(self.side, ("tall", "wide", "long"))
        if (adjective == "tall" and tall <= 1.5 * wide) or (adjective == "low" and long <= 1.5 * tall):
            return False
        for thing in re.split(", | and ", things) if things else ():
            match = re.fullmatch(THING, thing)
            parts = self.parts(match["n"], match["x"]) if match else []
            if match is None or not parts or (match["c"] and not self.in_columns(match["c"], match["r"], parts)):
                return False
        return True


def number_of(word: str) -> int:
    """Return the number that a word or digits say; 1 for an article."""
    return 1 if word in ("a", "an") else NUMBER_WORDS.index(word) if word in NUMBER_WORDS else int(word)


def label_words(text: str) -> list[str]:
    """Return the words of a label as captions say them, in lower case."""
    words = [word.lower() for word in re.split(r"[\s_.\-]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)) if word]
    return PLAIN_WORDS.get(" ".join(words), words)


NUMBER = rf"(?:{'|'.join(NUMBER_WORDS)}|\d+)"
SIDE = "(?:tall|wide|long)"
THING = rf"(?P<n>an?|{NUMBER}) (?P<x>.+?)(?: in (?P<c>{NUMBER}) columns of (?P<r>{NUMBER}))?"
OPENING = "An? (?:(?P<adjective>tall|low) )?(?P<noun>.+?)(?: (?:with|that has) (?P<things>.+))?"
N, X = rf"(?:(?P<n>{NUMBER}) )?", "(?P<x>.+?)"
CAPTION_SENTENCES: dict[str, Callable[..., bool]] = {
    rf"It (?:is made|consists) of (?P<n>{NUMBER}) parts": lambda it, n: len(it.boxes) == number_of(n),
    "It is one piece": lambda it: len(it.boxes) == 1,
    "It is taller than it is (?P<a>wide|long)": lambda it, a: it.side("tall") > it.side(a),
    "It is wider than it is tall": lambda it: it.side("wide") > it.side("tall"),
    "It is longer than it is tall": lambda it: it.side("long") > it.side("tall"),
    rf"It is about as (?P<a>{SIDE}) as it is (?P<b>{SIDE})": lambda it, a, b: (
        abs(it.side(a) / it.side(b) - 1) < ABOUT_SHARE
    ),
    rf"It is about (?P<t>{'|'.join(TIMES)}) as (?P<a>{SIDE}) as it is (?P<b>{SIDE})": lambda it, t, a, b: (
        abs(it.side(a) / it.side(b) / TIMES[t] - 1) < ABOUT_SHARE
    ),
    r"It(?:s height)? is (?P<d>\d+\.\d+) m(?: tall)?": lambda it, d: (
        it.record["unit"] == "metre" and abs(it.side("tall") - float(d)) < 0.006
    ),
    rf"(?:Its|The) {N}{X} (?:form|are arranged in) (?P<c>{NUMBER}) columns of (?P<r>{NUMBER})": lambda it, n, x, c, r: (
        it.in_columns(c, r, it.parts(n, x))
    ),
    f"The {N}{X} are one above the other": lambda it, n, x: it.in_stack(it.parts(n, x)),
    f"The {N}{X} (?:are in a row, at equal distances|form a straight row)": lambda it, n, x: it.in_row(it.parts(n, x)),
    f"The {N}{X} form a circle": lambda it, n, x: it.in_circle(it.parts(n, x)),
    f"It (?:stands|rests) on (?:its )?{N}{X}": lambda it, n, x: it.stands_on(it.parts(n, x)),
    f"The {N}{X} (?:is|are) above the (?:(?P<m>{NUMBER}) )?(?P<y>.+)": lambda it, n, x, m, y: it.is_above(
        it.parts(n, x), it.parts(m, y)
    ),
    f"Every {X} touches (?:at least one of )?the (?:(?P<m>{NUMBER}) )?(?P<y>.+)": lambda it, x, m, y: it.all_touch(
        it.alike(x), it.parts(m, y)
    ),
    f"The {N}{X} (?:is|are) [a-z]+(?: [a-z]+)?": lambda it, n, x: bool(it.parts(n, x)),
    "(?:All of it is|It is) [a-z]+(?: [a-z]+)?(?: all over)?": lambda it: True,
    "It stands by itself": lambda it: it.record["physics"]["stable"],
    "It does not stand by itself": lambda it: not it.record["physics"]["stable"],
    "Not all of its parts are connected to the ground": lambda it: not it.record["physics"]["rooted"],
    r"(?:It stays upright on ground that slopes|It does not tip over when it is tilted) by (?P<d>\d+) degrees": (
        lambda it, d: it.record["physics"]["tipping_degrees"] > float(d)
    ),
    "It is symmetric about an upright plane": lambda it: it.record["physics"]["symmetry"] > 0.99,
}
"""Sentences of captions, and whether they hold; the first that a sentence matches counts."""


def caption_faults(captions: dict[str, str], facts: CaptionFacts) -> Iterator[str]:
    """Yield sentences of captions that cannot be read, and those that do not hold. Of colors only the parts count."""
    for length, caption in captions.items():
        for place, sentence in enumerate(re.split(r"(?<=\.) ", caption)):
            known = CAPTION_SENTENCES if place else {OPENING: CaptionFacts.opens}
            found = ((re.fullmatch(rf"(?:{text})\.", sentence), holds) for text, holds in known.items())
            match, holds = next((pair for pair in found if pair[0]), (None, None))
            if match is None or holds is None:
                yield f"its {length} caption says {sentence!r}, which cannot be read"
            elif not holds(facts, **match.groupdict()):
                yield f"its {length} caption says {sentence!r}, which does not hold"


def file_digest(path: Path) -> str:
    """Return the sha256 of a file."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def component_of(count: int, pairs: np.ndarray) -> np.ndarray:
    """Return a representative of the connected component of each of `count` nodes, int64 (count,). pairs: (2, n)."""
    parent = list(range(count))

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for first, second in pairs.T.tolist():
        parent[root(first)] = root(second)
    return np.array([root(node) for node in range(count)], dtype=np.int64)


def component_count(count: int, pairs: np.ndarray) -> int:
    """Return the number of connected components of `count` nodes. pairs: (2, n)."""
    return len(np.unique(component_of(count, pairs)))


def pair_faults(name: str, pairs: np.ndarray, count: int) -> Iterator[str]:
    """Yield what is wrong with pairs of parts, (2, n)."""
    if not pairs.size:
        return
    if pairs.min() < 0 or pairs.max() >= count:
        yield f"{name} names a part that the record does not have"
    if (pairs[0] >= pairs[1]).any() or len(np.unique(pairs, axis=1).T) != pairs.shape[1]:
        yield f"{name} holds a pair twice, of one part, or in the wrong order"


def rooted_faults(
    record: dict[str, Any], triangles: list[np.ndarray], joints: np.ndarray, diagonal: float
) -> Iterator[str]:
    """Yield a verdict on rootedness that joints and heights contradict; parts near the limit are left open."""
    lowest = np.array([part[..., 1].min() for part in triangles])
    ground = record["bounds"][0][1]
    margin = 1e-4 * diagonal
    tolerance = float(record["joint_tolerance"])
    component = component_of(len(triangles), joints)
    surely = set(component[lowest <= ground + margin].tolist())
    possibly = set(component[lowest <= ground + tolerance + margin].tolist())
    if record["physics"]["rooted"] and set(component.tolist()) - possibly:
        yield "is called rooted, and a part is not connected to the ground"
    if not record["physics"]["rooted"] and not set(component.tolist()) - surely:
        yield "is called not rooted, and all parts are connected to the ground"


def glb_extras(content: bytes) -> dict[str, dict[str, Any]]:
    """Return the `extras` of the nodes of a GLB that have a class, by name."""
    length = struct.unpack_from("<I", content, 12)[0]
    nodes = json.loads(content[20 : 20 + length])["nodes"]
    return {node["name"]: node["extras"] for node in nodes if "class" in node.get("extras", {})}


def drawing_faults(name: str, content: bytes, camera: dict[str, Any], triangles: np.ndarray) -> Iterator[str]:
    """Yield a drawing whose ink does not reach as far as the mesh, triangles (t, 3, 3), does in its camera.

    What is thinner than two pixels may be drawn or not: it can lie between the centres of pixels.
    """
    pixels = grey_png(content)
    if pixels.shape != (camera["height"], camera["width"]):
        yield f"{name} has {pixels.shape} pixels, its camera {camera['height']} x {camera['width']}"
        return
    rows, columns = np.nonzero(pixels < INK_LEVEL)
    if not len(rows):
        yield f"{name} is blank"
        return
    seen = triangles.reshape(-1, 3) @ np.array(camera["world_to_camera"])[:3, :3].T
    seen = seen + np.array(camera["world_to_camera"])[:3, 3]
    depth = seen[:, 2:] if camera["projection"] == "perspective" else np.ones((len(seen), 1))
    if (depth <= 0).any():
        return
    places = np.concatenate([seen[:, :2] / depth, np.ones((len(seen), 1))], axis=1) @ np.array(camera["intrinsics"]).T
    limit = OUTLINE_PIXELS + float(camera["line_width"])
    size = np.array([camera["width"], camera["height"]])
    whole = np.clip([places[:, :2].min(axis=0), places[:, :2].max(axis=0)], 0, size)
    ink = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    outwards = np.array([[-1], [1]])
    beyond, short = (outwards * (ink - whole)).max(), 0.0
    if (outwards * (whole - ink)).max() > limit:
        covered = covered_blocks(places[:, :2].reshape(-1, 3, 2), pixels.shape)
        rows, columns = np.nonzero(covered)
        if len(rows):
            thick = np.array([[columns.min(), rows.min()], [columns.max() + 2, rows.max() + 2]])
            short = (outwards * (thick - ink)).max()
    if max(beyond, short) > limit:
        yield f"{name}: the outline of the drawing is {max(beyond, short):.0f} pixels from that of the mesh"


def covered_blocks(triangles: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return where triangles (t, 3, 2), in pixels, cover the centres of a block of two by two pixels, by the block's
    first pixel, bool (h - 1, w - 1).

    shape: height and width of the picture
    """
    covered = np.zeros(shape, dtype=bool)
    first = np.clip(np.ceil(triangles.min(axis=1) - 0.5), 0, None).astype(int)
    last = np.clip(np.floor(triangles.max(axis=1) - 0.5), None, [shape[1] - 1, shape[0] - 1]).astype(int)
    for number in np.flatnonzero((first <= last).all(axis=1)).tolist():
        (left, top), (right, bottom) = first[number], last[number]
        corners = triangles[number]
        sides = np.roll(corners, -1, axis=0) - corners
        x, y = np.arange(left, right + 1) + 0.5, np.arange(top, bottom + 1)[:, None] + 0.5
        turns = [dx * (y - ay) - dy * (x - ax) for (dx, dy), (ax, ay) in zip(sides, corners, strict=True)]
        inside = (np.min(turns, axis=0) >= 0) | (np.max(turns, axis=0) <= 0)
        covered[top : bottom + 1, left : right + 1] |= inside
    blocks: np.ndarray = covered[:-1, :-1] & covered[1:, :-1] & covered[:-1, 1:] & covered[1:, 1:]
    return blocks


def grey_png(content: bytes) -> np.ndarray:
    """Return the pixels of an 8-bit grey PNG without interlacing, uint8 (h, w). Raises ValueError for another file."""
    if content[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError("no PNG")
    place, data, header = 8, b"", b""
    while place < len(content):
        size, kind = struct.unpack_from(">I4s", content, place)
        body = content[place + 8 : place + 8 + size]
        header, data = (body if kind == b"IHDR" else header), (data + body if kind == b"IDAT" else data)
        place += size + 12
    width, height, depth, color, _, _, interlace = struct.unpack(">IIBBBBB", header)
    if (depth, color, interlace) != (8, 0, 0):
        raise ValueError("no grey PNG of 8 bits")
    lines = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, width + 1)
    pixels = np.zeros((height, width), np.uint8)
    above = np.zeros(width, np.int64)
    for row, line in enumerate(lines):
        pixels[row] = above = unfiltered(int(line[0]), line[1:].astype(np.int64), above)
    return pixels


def unfiltered(kind: int, line: np.ndarray, above: np.ndarray) -> np.ndarray:
    """Return a line of a PNG without its filter, int64 (w,)."""
    if kind == 0:
        return line
    if kind == 1:
        return np.cumsum(line) % 256
    result: np.ndarray = (line + above) % 256
    if kind == 2:
        return result
    result = np.zeros_like(line)
    left = corner = 0
    for column, value in enumerate(line.tolist()):
        up = int(above[column])
        if kind == 3:
            guess = (left + up) // 2
        else:
            gaps = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
            guess = (left, up, corner)[gaps.index(min(gaps))]
        left, corner = (value + guess) % 256, up
        result[column] = left
    return result


@contextmanager
def still_running() -> Iterator[None]:
    """Print the time that has passed to stderr, every few seconds, while the block runs."""
    start, ended = time.monotonic(), threading.Event()

    def refresh() -> None:
        while not ended.wait(SECONDS_BETWEEN_LINES):
            print(f"verifying, {time.monotonic() - start:.0f} s elapsed", file=sys.stderr)

    thread = threading.Thread(target=refresh, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def main() -> int:
    """Verify, print, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).resolve().parent)
    parser.add_argument("--samples", default="100", help="samples whose geometry is checked: a number, or all")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of samples")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    options = parser.parse_args()
    samples = None if options.samples == "all" else int(options.samples)
    with still_running():
        findings = verify(options.folder, samples, options.seed, options.workers)
    print("\n".join(findings.faults[:FAULTS_SHOWN]), end="\n" * bool(findings.faults))
    if len(findings.faults) > FAULTS_SHOWN:
        print(f"and {len(findings.faults) - FAULTS_SHOWN} more")
    print("checked:", ", ".join(f"{count} {what}" for what, count in findings.checked.items()))
    print(NOT_CHECKED)
    if findings.partial:
        kits = ", ".join(sorted(findings.partial))
        print(
            f"not checked either: parts that touch outside of contacts.npy in {kits}, whose kinds of contact are chosen"
        )
    print(f"{len(findings.faults)} faults" if findings.faults else "good")
    return 1 if findings.faults else 0


if __name__ == "__main__":
    sys.exit(main())
