"""Compression: the bytes of a shape as a string with categories, and whether it is restored exactly (strings §7)."""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from eval.engine.table import Cell, Table
from stages.shape.geometry.pose import pose_vectors
from stages.shape.kit import Assembly, Kit
from stages.strings.compression import Codebook, decode_shape, encode_shape, pack, unpack
from stages.strings.encoder import Encoded
from stages.strings.settings import Edges

COLUMNS = (
    "shapes of",
    "edges",
    "shapes",
    "exact %",
    "worst gap",
    "parts",
    "own poses",
    "bytes",
    "text gz",
    "record gz",
    "GLB",
    "GLB gz",
    "GLB / bytes",
    "record gz / bytes",
)

NOTES = (
    "Mean bytes per shape. Bytes: its canonical string, the category of each edge and the pose of its first part, each "
    "shape packed alone. Text gz: strings and categories of all shapes as text, without poses, in one gzip file. "
    "Record gz: their JSON records in one gzip file. "
    "GLB, GLB gz: the mesh file, plain and in its own gzip file. Only the GLB "
    "holds the meshes of the parts; strings and records take them from the kit.",
    "Exact: the decoded shape has the types, the poses within the kit's tolerance, and the contacts of the original. "
    "Contacts that a spanning tree leaves out are found by the kit's dockings. Worst gap: in tolerances. Own poses: "
    "parts per shape, after the first, that no category places.",
)


@dataclass(frozen=True)
class StoredSample:
    """A sample of a dataset: its assembly, and the bytes of its record and its GLB."""

    assembly: Assembly
    record: bytes
    glb: bytes


@dataclass(frozen=True)
class RoundTrip:
    """A shape that was packed and restored."""

    packed: bytes
    text: str
    """Its string and categories, readable."""
    own_poses: int
    """Parts, after the first, with a pose of their own."""
    restored: Assembly
    gap: float
    """Greatest displacement of a part, in tolerances of the kit."""
    exact: bool


def round_trip(book: Codebook, assembly: Assembly) -> RoundTrip:
    """Pack an assembly and restore it. Raises NotConnectedError if it has no string."""
    canonical, *_ = book.writer.strings(book.writer.graph(assembly), 0, np.random.default_rng(0))
    code = encode_shape(book, assembly, canonical)
    packed = pack(book, code)
    restored = decode_shape(book, unpack(book, packed))
    gap = _gap(book.kit, assembly, canonical, restored)
    same = np.array_equal(restored.types, assembly.types[canonical.nodes])
    same = same and _pairs(canonical.nodes[restored.edges]) == _pairs(assembly.edges)
    text = code.string + " " + " ".join(str(category) for category in code.categories if category >= 0)
    return RoundTrip(packed, text, len(code.poses) - 1, restored, gap, same and gap <= 1.0)


def compression_row(
    name: str, kit: Kit, edges: Edges, stored: Sequence[StoredSample], trips: Sequence[RoundTrip]
) -> tuple[Cell, ...]:
    """Return the row of the samples of a kit and their round trips."""
    count = len(stored)
    packed = fmean(len(trip.packed) for trip in trips)
    record = len(gzip.compress(b"\n".join(sample.record for sample in stored), mtime=0)) / count
    glb = fmean(len(sample.glb) for sample in stored)
    return (
        name,
        edges,
        count,
        100 * fmean(trip.exact for trip in trips),
        max(trip.gap for trip in trips),
        fmean(len(sample.assembly) for sample in stored),
        fmean(trip.own_poses for trip in trips),
        packed,
        len(gzip.compress("\n".join(trip.text for trip in trips).encode(), mtime=0)) / count,
        record,
        glb,
        fmean(len(gzip.compress(sample.glb, mtime=0)) for sample in stored),
        glb / packed,
        record / packed,
    )


def compression_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """Return the table of rows of `compression_row`."""
    return Table("Shapes as strings and categories", COLUMNS, tuple(rows), NOTES)


def _gap(kit: Kit, assembly: Assembly, encoded: Encoded, restored: Assembly) -> float:
    gaps = []
    for kind, pose, original in zip(restored.types, restored.poses, assembly.poses[encoded.nodes], strict=True):
        length = kit.types[kind].diagonal / 2
        gaps.append(np.linalg.norm(pose_vectors(pose[None], length) - pose_vectors(original[None], length)))
    return float(max(gaps)) / kit.pose_tolerance


def _pairs(edges: np.ndarray) -> set[tuple[int, int]]:
    return {(min(i, j), max(i, j)) for i, j in edges.tolist()}
