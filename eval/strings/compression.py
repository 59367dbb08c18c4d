"""How few bytes a shape takes as string and categories, and whether it comes back exactly (strings §7)."""

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
    "strings tell of",
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
    "Bytes a shape, means. Bytes: its canonical string, the category of each edge and the pose of its first part, "
    "packed, each shape by itself. Text gz: strings and categories of all shapes as text, without poses, in one gzip "
    "file; record gz: their JSON records in one; GLB, GLB gz: the mesh file as it is, and each by itself in gzip. The "
    "parts themselves stand in the GLB alone; strings and records borrow them from the kit.",
    "Exact: unpacked and decoded, all parts have their types, the poses of the record within the kit's tolerance, and "
    "the same contacts; those that a tree leaves out are found again by the kit's dockings. Worst gap: in tolerances. "
    "Own poses: parts beside the first that no category places, a shape.",
)


@dataclass(frozen=True)
class Stored:
    """A sample as it is stored now: its assembly, and the bytes of its record and its mesh file."""

    assembly: Assembly
    record: bytes
    glb: bytes


@dataclass(frozen=True)
class Trip:
    """A shape that went to bytes and came back. text: string and categories for people; own_poses: of parts beside the
    first; gap: the greatest displacement of a part, in tolerances of the kit; exact: whether nothing else differs."""

    packed: bytes
    text: str
    own_poses: int
    restored: Assembly
    gap: float
    exact: bool


def round_trip(book: Codebook, assembly: Assembly) -> Trip:
    """Bring an assembly to bytes and back. Raises NotConnectedError where it has no string."""
    canonical, *_ = book.writer.strings(book.writer.graph(assembly), 0, np.random.default_rng(0))
    described = encode_shape(book, assembly, canonical)
    packed = pack(book, described)
    restored = decode_shape(book, unpack(book, packed))
    gap = _gap(book.kit, assembly, canonical, restored)
    same = np.array_equal(restored.types, assembly.types[canonical.nodes])
    same = same and _pairs(canonical.nodes[restored.edges]) == _pairs(assembly.edges)
    text = described.string + " " + " ".join(str(each) for each in described.categories if each >= 0)
    return Trip(packed, text, len(described.poses) - 1, restored, gap, same and gap <= 1.0)


def compression_row(
    name: str, kit: Kit, edges: Edges, stored: Sequence[Stored], trips: Sequence[Trip]
) -> tuple[Cell, ...]:
    """The row of the samples of a kit and what has become of each."""
    count = len(stored)
    packed = fmean(len(each.packed) for each in trips)
    record = len(gzip.compress(b"\n".join(each.record for each in stored), mtime=0)) / count
    glb = fmean(len(each.glb) for each in stored)
    return (
        name,
        edges,
        count,
        100 * fmean(each.exact for each in trips),
        max(each.gap for each in trips),
        fmean(len(each.assembly) for each in stored),
        fmean(each.own_poses for each in trips),
        packed,
        len(gzip.compress("\n".join(each.text for each in trips).encode(), mtime=0)) / count,
        record,
        glb,
        fmean(len(gzip.compress(each.glb, mtime=0)) for each in stored),
        glb / packed,
        record / packed,
    )


def compression_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """The rows of `compression_row`."""
    return Table("Shapes as strings and categories", COLUMNS, tuple(rows), NOTES)


def _gap(kit: Kit, assembly: Assembly, encoded: Encoded, restored: Assembly) -> float:
    gaps = []
    for kind, found, wanted in zip(restored.types, restored.poses, assembly.poses[encoded.nodes], strict=True):
        length = kit.types[kind].diagonal / 2
        gaps.append(np.linalg.norm(pose_vectors(found[None], length) - pose_vectors(wanted[None], length)))
    return float(max(gaps)) / kit.pose_tolerance


def _pairs(edges: np.ndarray) -> set[tuple[int, int]]:
    return {(min(i, j), max(i, j)) for i, j in edges.tolist()}
