"""Exact compression of a shape to a string and the category of each of its edges (strings §6, §7).

Along a string, each part after the first is at a pose in which parts of its label dock to its parent: the edge's
category. Categories are chosen relative to the decoded parent, so that errors do not add up. A part that no category
places within the kit's tolerance has a pose of its own, so every part is restored. Geometry comes from the kit. The
paper's categories are clusters over many variations; ours are the kit's dockings and their images under symmetries.

Brackets and cycle numbers have no category: the tree determines all poses. Contacts that strings leave out are found as
the pairs of parts in a docking of the kit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray, TypeArray
from stages.shape.geometry.contact import overlapping_boxes, world_boxes
from stages.shape.geometry.pose import invert, pose_vectors, relative_poses
from stages.shape.kit import Assembly, Kit
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges
from stages.strings.tokens import number_text, number_value, split_tokens

NO_CATEGORY = -1
"""Of brackets and cycle numbers."""
MAX_TOKENS = 1_000_000
"""Bytes with more tokens are refused."""


@dataclass(frozen=True)
class ShapeCode:
    """The code of one shape."""

    string: str
    categories: tuple[int, ...]
    """Of each token."""
    poses: Float32Array
    """Rotation vector and translation of the first part and of parts without a category, in order, float32 (s, 6)."""


class Codebook:
    """The shared knowledge of encoder and decoder: a kit, and which contacts its strings contain."""

    def __init__(self, kit: Kit, edges: Edges) -> None:
        self.kit, self.edges = kit, edges
        self.writer = KitStrings(kit, edges)
        self.alphabet = self.writer.alphabet
        self.kinds: list[list[int]] = [
            np.flatnonzero(kit.label_of == label).tolist() for label in range(len(kit.labels))
        ]
        """The types of each label."""
        self._dockings: dict[tuple[int, int], tuple[TypeArray, FloatArray]] = {}

    def dockings(self, parent: int, label: int) -> tuple[TypeArray, FloatArray]:
        """Return types int16 (k,) and poses (k, 4, 4) of parts of a label docked to a part of type `parent`.

        A category below k is one of these; from k on it is a type of the label with a pose of its own.
        """
        if (parent, label) not in self._dockings:
            poses = [self.writer.table.poses(parent, kind) for kind in self.kinds[label]]
            types = np.repeat(np.array(self.kinds[label], dtype=np.int16), [len(of_type) for of_type in poses])
            self._dockings[parent, label] = types, np.concatenate(poses)
        return self._dockings[parent, label]

    def radix(self, parent: int | None, label: int) -> int:
        """Return the number of categories of a part of a label with a parent of some type, or as the first part."""
        return len(self.kinds[label]) + (0 if parent is None else len(self.dockings(parent, label)[0]))


def encode_shape(book: Codebook, assembly: Assembly, encoded: Encoded) -> ShapeCode:
    """Encode an assembly along one of its strings. Raises ValueError for a mirrored part."""
    decoded = decode(encoded.string, book.alphabet)
    types, poses = assembly.types[encoded.nodes], assembly.poses[encoded.nodes]
    decoded_poses = np.empty_like(poses)
    categories: list[int] = []
    stored: list[Float32Array] = []
    for token in decoded.tokens:
        if token.kind != "node":
            categories.append(NO_CATEGORY)
            continue
        node, kind = token.node, int(types[token.node])
        label = int(decoded.types[node])
        category, first = None, 0
        if token.edge >= 0:
            parent = int(decoded.edges[token.edge][0])  # a parent precedes its child
            kinds, docked = book.dockings(int(types[parent]), label)
            first = len(kinds)
            category = _nearest(book.kit, kinds, docked, kind, invert(decoded_poses[parent]) @ poses[node])
        if category is None:
            stored.append(_stored(poses[node]))
            decoded_poses[node] = _pose(stored[-1])
            category = first + book.kinds[label].index(kind)
        else:
            decoded_poses[node] = decoded_poses[parent] @ docked[category]
        categories.append(category)
    return ShapeCode(encoded.string, tuple(categories), np.array(stored, dtype=np.float32))


def decode_shape(book: Codebook, code: ShapeCode) -> Assembly:
    """Decode an assembly, its parts in the order of the string. Raises ValueError for a code of no shape of the kit."""
    decoded = decode(code.string, book.alphabet)
    if len(code.categories) != len(decoded.tokens):
        raise ValueError(f"{len(decoded.tokens)} tokens have {len(code.categories)} categories")
    types = np.empty(len(decoded.types), dtype=np.int16)
    poses = np.empty((len(types), 4, 4))
    stored = iter(code.poses)
    for token, category in zip(decoded.tokens, code.categories, strict=True):
        if token.kind != "node":
            continue
        node, label = token.node, int(decoded.types[token.node])
        parent = int(decoded.edges[token.edge][0]) if token.edge >= 0 else None
        if not 0 <= category < book.radix(None if parent is None else int(types[parent]), label):
            raise ValueError(f"part {node} has category {category}, which the kit does not have")
        kinds, docked = book.dockings(int(types[parent]), label) if parent is not None else ((), ())
        if category < len(kinds):
            types[node], poses[node] = kinds[category], poses[parent] @ docked[category]
            continue
        own = next(stored, None)
        if own is None:
            raise ValueError(f"part {node} has no pose")
        types[node], poses[node] = book.kinds[label][category - len(kinds)], _pose(own)
    if next(stored, None) is not None:
        raise ValueError("there are more poses than parts without a category")
    placed = Assembly(types, poses, decoded.edges)
    return placed if book.edges == "all" else Assembly(types, poses, _docked(book, placed))


def pack(book: Codebook, code: ShapeCode) -> bytes:
    """Pack a code to bytes: tokens and categories as mixed-radix digits of one number, then the poses."""
    texts = split_tokens(code.string)
    numbers = 1 + max((number_value(text) or 0 for text in texts if number_value(text) is not None), default=-1)
    labels = len(book.kit.labels)
    bases = labels + 2 + numbers
    values = {**book.alphabet.types, "(": labels, ")": labels + 1}
    digits: list[tuple[int, int]] = []
    walk = _Walk(book)
    for text, category in zip(texts, code.categories, strict=True):
        value = values[text] if text in values else labels + 2 + _number(text)
        digits.append((value, bases))
        radix = walk.step(value)
        if radix is not None:
            digits.append((category, radix))
            walk.put(category)
    whole = 0
    for digit, base in reversed(digits):
        whole = whole * base + digit
    content = whole.to_bytes((whole.bit_length() + 7) // 8, "little")
    header = b"".join(map(_varint, (len(texts), numbers, len(content))))
    return header + content + code.poses.astype("<f4").tobytes()


def unpack(book: Codebook, content: bytes) -> ShapeCode:
    """Unpack a code. Raises ValueError for bytes that `pack` does not write."""
    offset, header = 0, []
    for _ in range(3):
        value, offset = _read_varint(content, offset)
        header.append(value)
    count, numbers, size = header
    body, rest = content[offset : offset + size], content[offset + size :]
    if len(body) < size or len(rest) % 24:
        raise ValueError("the bytes of a shape end early")
    whole, labels = int.from_bytes(body, "little"), len(book.kit.labels)
    if max(count, numbers) > MAX_TOKENS:
        raise ValueError(f"the bytes of a shape ask for {max(count, numbers):,} tokens")
    texts: list[str] = []
    categories: list[int] = []
    walk = _Walk(book)
    for _ in range(count):
        whole, value = divmod(whole, labels + 2 + numbers)
        texts.append(_text(book, value))
        radix = walk.step(value)
        if radix is None:
            categories.append(NO_CATEGORY)
            continue
        whole, category = divmod(whole, radix)
        categories.append(category)
        walk.put(category)
    if whole:
        raise ValueError("the bytes of a shape hold more than its tokens")
    return ShapeCode("".join(texts), tuple(categories), np.frombuffer(rest, "<f4").reshape(-1, 6).astype(np.float32))


class _Walk:
    """Tracks the parent of each token, token by token, since types are known only as they come."""

    def __init__(self, book: Codebook) -> None:
        self._book = book
        self._here: int | None = None
        self._branches: list[int] = []
        self._label = 0

    def step(self, value: int) -> int | None:
        """Take one token; return the number of categories of a part, for `put`, or None."""
        labels = len(self._book.kit.labels)
        if value < labels:
            self._label = value
            return self._book.radix(self._here, value)
        if value == labels and self._here is not None:
            self._branches.append(self._here)
        elif value == labels + 1 and self._branches:
            self._here = self._branches.pop()
        elif value <= labels + 1:
            raise ValueError("the brackets of a string do not match")
        return None

    def put(self, category: int) -> None:
        """Set the category, and thereby the type, of the part just taken."""
        kinds = self._book.dockings(self._here, self._label)[0].tolist() if self._here is not None else []
        self._here = [*kinds, *self._book.kinds[self._label]][category]


def _nearest(kit: Kit, kinds: TypeArray, docked: FloatArray, kind: int, pose: FloatArray) -> int | None:
    """Return the category that places a part of type `kind` nearest to `pose` (4, 4), if within tolerance."""
    own = np.flatnonzero(kinds == kind)
    if not len(own):
        return None
    length = kit.types[kind].diagonal / 2
    gaps = np.linalg.norm(pose_vectors(docked[own], length) - pose_vectors(pose[None], length), axis=1)
    return int(own[gaps.argmin()]) if gaps.min() <= kit.pose_tolerance else None


def _docked(book: Codebook, assembly: Assembly) -> IntArray:
    """Return the pairs of parts in a docking of the kit, int32 (m, 2)."""
    boxes = world_boxes(book.kit.types, assembly.types, assembly.poses)
    pairs = overlapping_boxes(boxes, book.kit.contact_tolerance + 2 * book.kit.pose_tolerance)
    labels = book.writer.table.label_edges(assembly.types, assembly.poses, pairs)[:, 0]
    for row, pose in zip(
        np.flatnonzero(labels < 0).tolist(), relative_poses(assembly.poses, pairs[labels < 0]), strict=True
    ):
        a, b = (int(assembly.types[part]) for part in pairs[row])
        labels[row] = 0 if book.writer.table.fit(a, b, pose) is not None else -1
    docked: IntArray = pairs[labels >= 0]
    return docked


def _stored(pose: FloatArray) -> Float32Array:
    """Return a pose (4, 4) as rotation vector and translation, float32 (6,)."""
    from scipy.spatial.transform import Rotation

    if np.linalg.det(pose[:3, :3]) < 0:
        raise ValueError("a mirrored part has no rotation")
    turn = Rotation.from_matrix(pose[:3, :3]).as_rotvec()
    return np.concatenate([turn, pose[:3, 3]]).astype(np.float32)


def _pose(stored: Float32Array) -> FloatArray:
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(stored[:3].astype(np.float64)).as_matrix()
    pose[:3, 3] = stored[3:]
    return pose


def _text(book: Codebook, value: int) -> str:
    tokens = (*book.alphabet.tokens, "(", ")")
    return tokens[value] if value < len(tokens) else number_text(value - len(tokens))


def _number(text: str) -> int:
    number = number_value(text)
    if number is None:
        raise ValueError(f"{text!r} is no token of the kit")
    return number


def _varint(value: int) -> bytes:
    """Encode seven bits a byte, low ones first; the top bit marks that more follow."""
    written = bytearray()
    while value > 127:
        written.append(value & 127 | 128)
        value >>= 7
    return bytes([*written, value])


def _read_varint(content: bytes, offset: int) -> tuple[int, int]:
    """Return the number at an offset, and the offset after it."""
    value = shift = 0
    while True:
        if offset >= len(content) or shift > 28:
            raise ValueError("the bytes of a shape end early")
        value |= (content[offset] & 127) << shift
        offset, shift = offset + 1, shift + 7
        if content[offset - 1] < 128:
            return value, offset
