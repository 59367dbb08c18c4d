"""Shapes as strings and categories, packed to bytes and restored."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.pose import pose_vectors
from stages.shape.kit import Assembly, Kit
from stages.strings.compression import NO_CATEGORY, Codebook, ShapeCode, decode_shape, encode_shape, pack, unpack
from stages.strings.encoder import Encoded
from stages.strings.settings import Edges
from stages.strings.tokens import split_tokens
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.stages.strings.test_kit_strings import kit_of, pairs
from tests.toy_kits.program_chairs import write_chairs

EDGES: tuple[Edges, ...] = ("all", "faces", "tree")


@cache
def book_of(name: str, edges: Edges) -> Codebook:
    return Codebook(kit_of(name), edges)


def strings_of(book: Codebook, assembly: Assembly, count: int, seed: int) -> list[Encoded]:
    return book.writer.strings(book.writer.graph(assembly), count, np.random.default_rng(seed))


def gaps(kit: Kit, assembly: Assembly, other: Assembly) -> list[float]:
    """How far each part stands from where it should, in tolerances."""
    found = []
    for kind, one, two in zip(assembly.types, assembly.poses, other.poses, strict=True):
        first, second = (pose_vectors(pose[None], kit.types[kind].diagonal / 2) for pose in (one, two))
        found.append(float(np.linalg.norm(first - second)) / kit.pose_tolerance)
    return found


def assert_comes_back(book: Codebook, assembly: Assembly, encoded: Encoded) -> ShapeCode:
    """Through bytes, with its parts in the order of the string: types, poses, contacts."""
    described = unpack(book, pack(book, encode_shape(book, assembly, encoded)))
    found = decode_shape(book, described)
    assert found.types.tolist() == assembly.types[encoded.nodes].tolist()
    wanted = replace(assembly, types=found.types, poses=assembly.poses[encoded.nodes])
    assert max(gaps(book.kit, wanted, found)) <= 1.0
    back = np.sort(encoded.nodes[found.edges], axis=1)
    assert pairs(back) == pairs(np.sort(assembly.edges, axis=1))
    return described


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("name", ["castle", "playground", "space-base", "temple", "cubes"])
def test_exemplars_are_rebuilt_from_any_string(name: str, edges: Edges) -> None:
    book = book_of(name, edges)
    for seed, exemplar in enumerate(book.kit.exemplars):
        for encoded in strings_of(book, exemplar.assembly, 2, seed):
            described = assert_comes_back(book, exemplar.assembly, encoded)
            assert len(described.poses) == 1, "every part but the first stands at a docking of the kit"
            tokens = split_tokens(encoded.string)
            parts = [token in book.alphabet.types for token in tokens]
            assert [category != NO_CATEGORY for category in described.categories] == parts


@pytest.fixture(scope="module")
def chairs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Kit, list[Assembly]]:
    """A kit of chairs with types by meaning, and variants of them."""
    shapes = tuple(ShapeFile(path=path) for path in write_chairs(tmp_path_factory.mktemp("chairs"), 4))
    kit = read_kit(KitConfig(name="chairs", shapes=shapes, types="meaning").resolve(STRICTEST))
    assert len(kit.labels) < len(kit.types)
    search = Search(ContactOracle(kit), SearchConfig())
    found, _ = search.run(np.random.default_rng(0), 1000, 12, "test", lambda count: None)
    variants = [item.assembly for item in found]
    assert any(set(variant.types.tolist()) - set(kit.exemplars[0].assembly.types.tolist()) for variant in variants)
    return kit, variants


@pytest.mark.slow
@pytest.mark.parametrize("edges", EDGES)
def test_parts_with_equal_labels_keep_their_own_surface(edges: Edges, chairs: tuple[Kit, list[Assembly]]) -> None:
    """Also where they dock as parts of their labels do, though these two were never seen to."""
    kit, variants = chairs
    book = Codebook(kit, edges)
    for assembly in (*(exemplar.assembly for exemplar in kit.exemplars), *variants):
        for encoded in strings_of(book, assembly, 1, 0):
            assert_comes_back(book, assembly, encoded)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(EDGES))
def test_shapes_are_restored_at_any_pose_with_one_part_moved(seed: int, edges: Edges) -> None:
    book, rng = book_of("cubes", edges), np.random.default_rng(seed)
    assembly = book.kit.exemplars[seed % 2].assembly
    motion = np.eye(4)
    motion[:3, :3] = Rotation.random(rng=rng).as_matrix()
    motion[:3, 3] = rng.normal(0, 100 * book.kit.pose_tolerance, 3)
    poses = motion @ assembly.poses
    moved = rng.integers(len(assembly))
    slip = np.eye(4)
    slip[:3, 3] = rng.normal(0, 3 * book.kit.pose_tolerance, 3)
    poses[moved] = poses[moved] @ slip
    (encoded, *_) = strings_of(book, assembly, 0, seed)
    described = encode_shape(book, Assembly(assembly.types, poses, assembly.edges), encoded)
    found = decode_shape(book, unpack(book, pack(book, described)))
    assert max(gaps(book.kit, Assembly(found.types, poses[encoded.nodes], found.edges), found)) <= 1.0
    assert 1 <= len(described.poses) <= 1 + 1 + len(assembly.neighbours()[moved])


def test_errors_do_not_accumulate_along_a_chain() -> None:
    """Each cube stands a little further from the one before than it should: in the end by ten tolerances and more."""
    book = book_of("cubes", "tree")
    stairs = book.kit.exemplars[1].assembly
    step = next(row for row, (i, j) in enumerate(stairs.edges.tolist()) if stairs.types[i] == stairs.types[j])
    i, j = stairs.edges[step]
    apart = stairs.poses[j][:3, 3] - stairs.poses[i][:3, 3]
    count = 40
    poses = np.tile(stairs.poses[i], (count, 1, 1))
    poses[:, :3, 3] += np.arange(count)[:, None] * apart * (1 + 0.5 * book.kit.pose_tolerance / np.linalg.norm(apart))
    row = Assembly(
        np.full(count, stairs.types[i], np.int16), poses, np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    )
    (encoded, *_) = strings_of(book, row, 0, 0)
    described = encode_shape(book, row, encoded)
    found = decode_shape(book, described)
    wanted = replace(row, poses=row.poses[encoded.nodes])
    assert max(gaps(book.kit, wanted, found)) <= 1.0
    assert 2 <= len(described.poses) <= count // 2, "now and then a part brings a pose of its own, and most do not"


def test_a_single_part_takes_a_header_of_three_bytes_and_a_pose() -> None:
    book = book_of("cubes", "all")
    exemplar = book.kit.exemplars[0].assembly
    alone = exemplar.select(np.array([0]))
    (encoded, *_) = strings_of(book, alone, 0, 0)
    packed = pack(book, encode_shape(book, alone, encoded))
    assert len(packed) in (27, 28)
    assert_comes_back(book, alone, encoded)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_corrupted_bytes_decode_to_another_shape_or_are_rejected(seed: int) -> None:
    book, rng = book_of("cubes", "all"), np.random.default_rng(seed)
    (encoded, *_) = strings_of(book, book.kit.exemplars[0].assembly, 0, 0)
    packed = bytearray(pack(book, encode_shape(book, book.kit.exemplars[0].assembly, encoded)))
    for place in rng.integers(0, len(packed), 2):
        packed[place] = rng.integers(256)
    spoiled = bytes(packed[: rng.integers(1, len(packed) + 1)] if seed % 2 else packed)
    try:
        found = decode_shape(book, unpack(book, spoiled))
    except ValueError:
        return
    assert len(found) == len(found.poses)


@pytest.mark.parametrize("cut", [0, 1, 2, 5, -1, -24])
def test_truncated_bytes_are_rejected(cut: int) -> None:
    book = book_of("cubes", "all")
    assembly = book.kit.exemplars[0].assembly
    packed = pack(book, encode_shape(book, assembly, strings_of(book, assembly, 0, 0)[0]))
    with pytest.raises(ValueError, match=r"end early|no pose|more than"):
        decode_shape(book, unpack(book, packed[:cut]))


def test_categories_that_the_kit_does_not_have_are_rejected() -> None:
    book = book_of("cubes", "all")
    assembly = book.kit.exemplars[0].assembly
    described = encode_shape(book, assembly, strings_of(book, assembly, 0, 0)[0])
    for changed, said in (
        (replace(described, categories=(99, *described.categories[1:])), "category 99"),
        (replace(described, categories=described.categories[:-1]), "categories"),
        (replace(described, poses=np.tile(described.poses, (2, 1))), "more poses"),
        (replace(described, poses=described.poses[:0]), "no pose"),
    ):
        with pytest.raises(ValueError, match=said):
            decode_shape(book, changed)


@pytest.mark.skipif(not (Path(__file__).resolve().parents[4] / "shared").is_dir(), reason="no public models here")
def test_shapes_with_hundreds_of_cycles_are_restored() -> None:
    shared = Path(__file__).resolve().parents[4] / "shared" / "exemplars"
    paths = tuple(shared / name / "model.glb" for name in ("a12_dungeon_room_large", "a13_dungeon_junction"))
    kit = read_kit(KitConfig(name="dungeon", shapes=paths).resolve(STRICTEST))
    for edges in EDGES:
        book = Codebook(kit, edges)
        for exemplar in kit.exemplars:
            for encoded in strings_of(book, exemplar.assembly, 1, 0):
                assert_comes_back(book, exemplar.assembly, encoded)
