"""Checks of every sample against its record: members, arrays, record, mesh, and the audits of stages."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.shards import bytes_array
from stages.package.glb import GL_FLOAT, glb_bytes
from stages.package.record import piece_count
from stages.shape.collection.discovery import audits
from stages.shape.collection.language import RebuildShape
from stages.shape.collection.members import TEXT
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.pose import rounded
from stages.shape.kit import Assembly
from stages.shape.shape import Shape

ROUNDING_SHARE = 1e-6
"""Difference of positions computed on another processor, as a share of the shape's size."""


class SampleError(Exception):
    """A sample that cannot be read; the message says why."""


def read_sample_record(content: bytes) -> dict[str, Any]:
    """Return the record of a sample. Raises SampleError."""
    try:
        record = json.loads(content)
    except ValueError as error:
        raise SampleError(f"its json cannot be read: {error}") from error
    if not isinstance(record, dict):
        raise SampleError("its json is no record")
    return record


def read_packaged(
    key: str,
    record: Mapping[str, Any],
    members: Mapping[str, bytes],
    rebuild: Mapping[str, RebuildShape],
    sections: Mapping[str, Any],
    labels: Mapping[str, Mapping[str, int]],
) -> PackagedSample:
    """Return the sample with the shape of its record.

    rebuild: function that rebuilds the shape of a record, by language
    labels: class of each label of each kit

    Raises SampleError for unreadable arrays or records, and LookupError where the source of the shape is missing.
    """
    arrays = {name: _array(name, content) for name, content in members.items() if name.endswith(".npy")}
    packaged = PackagedSample(key, record, members, arrays, _NOTHING, sections)
    try:
        shape = rebuild[record["language"]](record, packaged.contacts)
        assembly = replace(shape.assembly, poses=rounded(shape.assembly.poses))
        stated = {part["label"]: part["class"] for part in record["parts"]}
        known = labels.get(record["kit"], stated)
        ids = tuple(known.get(label, -1) for label in shape.labels)
        shape = replace(shape, assembly=assembly, class_ids=ids)
        return PackagedSample(key, record, members, arrays, shape, sections)
    except LookupError as error:
        if isinstance(error, KeyError | IndexError):
            raise SampleError(f"its json is invalid: nothing at {error}") from error
        raise
    except Exception as error:
        raise SampleError(f"its json is invalid: {error}") from error


def record_faults(record: Mapping[str, Any], key: str, split: str, kits: Collection[str]) -> Iterator[str]:
    """Yield a sentence for each fault of a record by itself."""
    if record.get("key") != key or record.get("split") != split:
        yield "its json names another key or split"
    if record.get("kit") not in kits:
        yield "its json names a kit that the manifest does not know"
    empty = list(empty_values(record))
    if empty:
        yield f"its json has nothing at {', '.join(empty[:3])}"


def sample_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each further fault of a sample."""
    record, shape = sample.record, sample.shape
    yield from _part_faults(record, shape)
    yield from _count_faults(sample)
    if not _same_mesh(sample.members["glb"], glb_bytes(shape, sample.record.get("hierarchy")), sample.size):
        yield _glb_fault(sample)
    if np.abs(np.array(record["bounds"]) - rounded(shape_bounds(shape))).max() > 1e-9 * sample.size:
        yield "its bounds are not those of its parts"
    if TEXT in sample.members and not sample.members[TEXT].decode().startswith(record["text"]):
        yield "its txt and its json hold different texts"
    for audit in audits().values():
        yield from _guarded(audit.faults, sample)


def array_faults(sample: PackagedSample, declared: list[dict[str, Any]]) -> Iterator[str]:
    """Yield a fault for each array whose type or shape differs from the manifest's, or that holds NaN or infinity."""
    lengths: dict[str, int] = {"parts": len(sample.record["parts"])}
    for member in declared:
        if not member["dtype"] or member["name"] not in sample.arrays:
            continue
        array, name = sample.arrays[member["name"]], member["name"]
        if array.dtype != np.dtype(member["dtype"]) or array.ndim != len(member["shape"]):
            yield f"{name} is {array.dtype} of {array.ndim} dimensions, not {member['dtype']} of {len(member['shape'])}"
            continue
        for wanted, actual in zip(member["shape"], array.shape, strict=True):
            if (wanted if isinstance(wanted, int) else lengths.setdefault(wanted, actual)) != actual:
                yield f"{name} has shape {array.shape}, not ({', '.join(map(str, member['shape']))})"
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            yield f"{name} holds what is not a number"


def empty_values(value: Any, path: str = "") -> Iterator[str]:
    """Yield the paths of nulls and empty texts, lists or mappings in a JSON value: `parts[3].label`."""
    if value is None or value in ("", [], {}):
        yield path or "the whole"
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from empty_values(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for position, item in enumerate(value):
            yield from empty_values(item, f"{path}[{position}]")


_NOTHING = Shape((), Assembly(np.empty(0, np.int16), np.empty((0, 4, 4)), np.empty((0, 2), np.int32)), "y", ())


def _array(name: str, content: bytes) -> np.ndarray:
    try:
        return bytes_array(content)
    except ValueError as error:
        raise SampleError(f"{name} cannot be read: {error}") from error


def _guarded(faults: Callable[[PackagedSample], Iterator[str]], sample: PackagedSample) -> Iterator[str]:
    """Yield the faults of a check; a record without a field that it reads is a fault."""
    try:
        yield from faults(sample)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        yield f"its json is invalid: {type(error).__name__}: {error}"


def _part_faults(record: Mapping[str, Any], shape: Shape) -> Iterator[str]:
    parts = record["parts"]
    if len(parts) != len(shape):
        yield f"its json lists {len(parts)} parts, and its source makes {len(shape)}"
        return
    for index, (part, name, label, number) in enumerate(
        zip(parts, shape.part_names, shape.part_labels.tolist(), shape.part_classes.tolist(), strict=True)
    ):
        if part.get("own_class", label) != label:
            yield f"its json says that part {index} has the class {part['own_class']} in its kit, which is {label}"
        actual = part["name"], part["label"], part["class"], part["instance"]
        if actual != (name, shape.labels[label], number, index):
            yield f"its json calls part {index} {actual}, and its source {(name, shape.labels[label], number, index)}"
            return
    poses = np.array([part["pose"] for part in parts])
    placed = shape.placements
    if poses.shape != placed.shape or np.abs(poses - rounded(placed)).max() > 1e-9:
        yield "its json has other poses than its source makes"


def _count_faults(sample: PackagedSample) -> Iterator[str]:
    pairs, parts = sample.contacts, len(sample.record["parts"])
    if len(pairs) and (pairs.min() < 0 or pairs.max() >= parts or (pairs[:, 0] >= pairs[:, 1]).any()):
        yield "its contacts are no pairs of its parts, the lower one first"
        return
    assembly = sample.shape.assembly
    pieces = piece_count(Assembly(assembly.types, assembly.poses, pairs))
    counted = {
        "parts": parts,
        "contacts": len(pairs),
        "pieces": pieces,
        "cycles": len(pairs) - parts + pieces,
        "types": len(set(sample.shape.part_labels.tolist())),
    }
    for name, count in counted.items():
        if sample.record["counts"][name] != count:
            yield f"its json counts {sample.record['counts'][name]} {name} and lists {count}"


def _same_mesh(actual: bytes, expected: bytes, size: float) -> bool:
    """Whether two GLBs are equal up to the last digits of positions and matrices, which vary by processor."""
    if actual == expected:
        return True
    if len(actual) != len(expected) or actual[:4] != b"glTF":
        return False
    starts = [28 + int.from_bytes(content[12:16], "little") for content in (actual, expected)]
    try:
        actual_header, expected_header = (
            json.loads(content[20 : start - 8]) for content, start in zip((actual, expected), starts, strict=True)
        )
    except ValueError:
        return False
    if not _alike(actual_header, expected_header, ROUNDING_SHARE * size):
        return False
    bodies = [content[start:] for content, start in zip((actual, expected), starts, strict=True)]
    placed = {
        accessor["bufferView"] for accessor in expected_header["accessors"] if accessor["componentType"] == GL_FLOAT
    }
    for number, view in enumerate(expected_header["bufferViews"]):
        begin = view.get("byteOffset", 0)
        stored, wanted = (body[begin : begin + view["byteLength"]] for body in bodies)
        if number not in placed and stored != wanted:
            return False
        if number in placed:
            gap = np.frombuffer(stored, "<f4") - np.frombuffer(wanted, "<f4")
            if not (np.abs(gap) <= ROUNDING_SHARE * size).all():
                return False
    return True


def _alike(actual: Any, expected: Any, near: float) -> bool:
    """Whether two JSON values are equal, numbers that are no whole ones being as near as `near`."""
    if isinstance(expected, float) and isinstance(actual, int | float):
        return abs(actual - expected) <= near
    if isinstance(expected, dict) and isinstance(actual, dict):
        return actual.keys() == expected.keys() and all(_alike(actual[name], expected[name], near) for name in expected)
    if isinstance(expected, list) and isinstance(actual, list):
        return len(actual) == len(expected) and all(_alike(*item, near) for item in zip(actual, expected, strict=True))
    return bool(actual == expected)


def _glb_fault(sample: PackagedSample) -> str:
    """Which part of the mesh it is."""
    import io

    import trimesh

    if not sample.members["glb"].startswith(b"glTF"):
        return "glb is no GLB"
    try:
        scene = trimesh.load_scene(io.BytesIO(sample.members["glb"]), file_type="glb", process=False)
    except Exception as error:  # trimesh raises whatever it trips over
        return f"glb cannot be read: {type(error).__name__}: {error}"
    shape = sample.shape
    for part, name in enumerate(shape.part_names):
        if name not in scene.graph.nodes:
            return f"{name} is not in its glb"
        pose, geometry = scene.graph.get(name)
        # trimesh makes the primitives of a part with several materials nodes below its node
        below = scene.graph.transforms.children.get(name, []) if geometry is None else [name]
        if not below:
            return f"{name} has no surface in its glb"
        primitives = [np.asarray(scene.geometry[scene.graph.get(node)[1]].triangles) for node in below]
        mesh = shape.meshes[shape.assembly.types[part]]
        stored = np.concatenate(primitives) @ pose[:3, :3].T + pose[:3, 3]
        placed = shape.assembly.poses[part]
        look = mesh.appearance
        faces = mesh.faces if look is None else mesh.faces[np.argsort(look.face_material, kind="stable")]
        expected = mesh.vertices[faces] @ placed[:3, :3].T + placed[:3, 3]
        if stored.shape != expected.shape or np.abs(stored - expected).max() > 1e-5 * sample.size:
            return f"{name} has another surface in its glb than its source makes"
    return "its glb is not the one that its record says"
