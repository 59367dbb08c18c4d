"""Edge categories encode the relative poses of tokens, and are decoded to poses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, Kit
from stages.strings.categories import DUMMY_CATEGORY, CategorySpace, NoCategoryError, token_edges
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges
from stages.strings.tokens import split_tokens
from tests.stages.strings.test_kit_strings import cubes, kit_of, shuffled
from tests.toy_kits.chains_and_rings import Placed, box, pose, with_arrow
from tests.toy_kits.chains_and_rings import kit_of as toy_kit
from tests.toy_kits.program_chairs import write_chairs

EDGES: tuple[Edges, ...] = ("all", "faces", "tree")


@cache
def space_of(name: str) -> CategorySpace:
    return CategorySpace(kit_of(name))


@cache
def roads() -> CategorySpace:
    """Posts of eight symmetries, and rods of four between them: straight on, and round a corner."""
    meshes = {"post": box(1, 2, 1), "rod": box(2, 0.4, 0.6)}
    straight = [("post", pose(3 * x, 0, 0)) for x in range(3)]
    straight += [("rod", pose(3 * x + 1.5, 0, 0)) for x in range(2)]
    corner: list[Placed] = [*straight[:2], straight[3], ("rod", pose(3, 0, 1.5, 1)), ("post", pose(3, 0, 3))]
    return CategorySpace(toy_kit(meshes, [straight, corner]))


@cache
def writer_of(space: CategorySpace, edges: Edges) -> KitStrings:
    return KitStrings(space.kit, edges)


def strings_of(space: CategorySpace, assembly: Assembly, edges: Edges, count: int, seed: int) -> list[Encoded]:
    writer = writer_of(space, edges)
    return writer.strings(writer.graph(assembly), count, np.random.default_rng(seed))


def labelled(space: CategorySpace, assembly: Assembly, encoded: Encoded) -> list[int]:
    (found,) = space.label(assembly, [encoded])
    return list(found.categories.tolist())


def gap(kit: Kit, found: Assembly, wanted: Assembly) -> float:
    """The greatest displacement of a part's surface, in tolerances, once the first parts lie on each other."""

    def images(kind: int, at: FloatArray) -> FloatArray:
        return pose_vectors(at @ kit.types[kind].symmetries, kit.types[kind].diagonal / 2)

    assert found.types.tolist() == wanted.types.tolist()
    least = np.inf
    for first in wanted.poses[0] @ kit.types[found.types[0]].symmetries:
        gaps = [
            np.linalg.norm(images(kind, here) - images(kind, there)[:1], axis=1).min()
            for kind, here, there in zip(
                found.types, first @ invert(found.poses[0]) @ found.poses, wanted.poses, strict=True
            )
        ]
        least = min(least, max(gaps))
    return float(least) / kit.pose_tolerance


def assert_comes_back(space: CategorySpace, assembly: Assembly, encoded: Encoded) -> list[int]:
    (one,) = space.label(assembly, [encoded])
    categories = list(one.categories.tolist())
    assert space.label(assembly, [Encoded(one.string, one.nodes)])[0].nodes.tolist() == one.nodes.tolist()
    wanted = Assembly(assembly.types[one.nodes], assembly.poses[one.nodes], assembly.edges)
    found = space.place(encoded.string, categories)
    assert gap(space.kit, found, wanted) <= 1.0
    allowed = space.allowed(encoded.string)
    assert allowed.shape == (len(categories), len(space))
    assert allowed[np.arange(len(categories)), categories].all()
    return categories


def test_tokens_have_their_edges() -> None:
    decoded = decode("A0(B1)(C)D(B)C01", space_of("castle").alphabet)
    assert token_edges(decoded).tolist() == [
        [-1, 0], [0, 5], [-1, -1], [0, 1], [1, 5], [-1, -1], [-1, -1], [0, 2], [-1, -1],
        [0, 3], [-1, -1], [3, 4], [-1, -1], [3, 5], [5, 0], [5, 1],
    ]  # fmt: skip


def test_categories_after_a_post_do_not_depend_on_the_pose_of_the_shape() -> None:
    space = roads()
    assert {pair: len(category_pair.poses) for pair, category_pair in space.pairs.items()} == {(0, 1): 4, (1, 0): 2}
    straight, corner = (exemplar.assembly for exemplar in space.kit.exemplars)
    string = "ABABA"
    found = []
    for assembly, nodes in ((straight, [0, 3, 1, 4, 2]), (corner, [0, 2, 1, 3, 4])):
        encoded = Encoded(string, np.array(nodes))
        categories = labelled(space, assembly, encoded)
        assert categories == labelled(space, assembly, Encoded(string, np.array(nodes[::-1]))), "from either end"
        moved = pose(4, 5, 6, 1) @ assembly.poses
        assert categories == labelled(space, Assembly(assembly.types, moved, assembly.edges), encoded)
        found.append(categories)
    (one, other), first = found, 1 + len(space.kit.types)
    assert one[:3] == other[:3] == [1, first, one[2]], "the first turn is the first place"
    assert one[3] != other[3], "straight on and a corner"
    assert one[4] == other[4] == one[2], "the far end of a rod is the far end of any"


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("name", ["castle", "playground", "space-base", "temple", "cubes"])
def test_exemplars_are_rebuilt_from_any_string(name: str, edges: Edges) -> None:
    space = space_of(name)
    for seed, exemplar in enumerate(space.kit.exemplars):
        for encoded in strings_of(space, exemplar.assembly, edges, 2, seed):
            categories = assert_comes_back(space, exemplar.assembly, encoded)
            is_bracket = [text in "()" for text in split_tokens(encoded.string)]
            assert [category == DUMMY_CATEGORY for category in categories] == is_bracket


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["castle", "playground", "cubes"]))
def test_categories_do_not_depend_on_the_pose_of_the_shape_or_on_symmetries(seed: int, name: str) -> None:
    space, rng = space_of(name), np.random.default_rng(seed)
    assembly = space.kit.exemplars[seed % 2].assembly
    encoded = strings_of(space, assembly, "all", 1, seed)[-1]
    order = np.argsort(np.random.default_rng(seed).permutation(len(assembly)))  # as `shuffled` draws it
    other = shuffled(assembly, np.random.default_rng(seed))
    for part, kind in enumerate(other.types):
        symmetries = space.kit.types[kind].symmetries
        other.poses[part] = other.poses[part] @ symmetries[rng.integers(len(symmetries))]
    assert labelled(space, other, Encoded(encoded.string, order[encoded.nodes])) == labelled(space, assembly, encoded)


@pytest.mark.parametrize("name", ["castle", "playground"])
def test_categories_are_the_least_over_all_frames_of_the_first_part(name: str) -> None:
    """By geometry alone: each child is held against every category and every one of its own symmetries."""
    space = space_of(name)
    kit, assembly = space.kit, space.kit.exemplars[0].assembly
    (encoded, *_) = strings_of(space, assembly, "all", 0, 0)
    decoded, types, poses = decode(encoded.string, space.alphabet), assembly.types[encoded.nodes], assembly.poses
    walks = []
    for root in kit.types[types[0]].symmetries:
        frames = poses[encoded.nodes]
        frames[0] = frames[0] @ root
        walk = []
        for text, (here, there) in zip(decoded.texts, token_edges(decoded).tolist(), strict=True):
            if here < 0:
                walk.append(DUMMY_CATEGORY if there < 0 else 1 + int(types[0]))
                continue
            length, symmetries = kit.types[types[there]].diagonal / 2, kit.types[types[there]].symmetries
            ours = np.flatnonzero((space.types == (types[here], types[there])).all(axis=1))
            asked = pose_vectors(frames[there] @ symmetries, length)
            offered = pose_vectors(frames[here] @ space.poses[ours], length)
            gaps = np.linalg.norm(asked - offered[:, None], axis=-1)
            place, symmetry = np.unravel_index(gaps.argmin(), gaps.shape)
            walk.append(int(ours[place]))
            if text in space.alphabet.types:
                frames[there] = frames[there] @ symmetries[symmetry]
        walks.append(walk)
    assert min(walks) == labelled(space, assembly, encoded)


def test_cycle_numbers_have_the_category_of_the_other_part() -> None:
    space = space_of("castle")
    assembly = space.kit.exemplars[1].assembly
    for encoded in strings_of(space, assembly, "all", 3, 1):
        categories, decoded = labelled(space, assembly, encoded), decode(encoded.string, space.alphabet)
        placed = space.place(encoded.string, categories)
        cycles = 0
        for text, (here, there), category in zip(decoded.texts, token_edges(decoded).tolist(), categories, strict=True):
            if not text.isdigit():
                continue
            cycles += 1
            kind = space.kit.types[placed.types[there]]
            reached = pose_vectors((placed.poses[here] @ space.poses[category])[None], kind.diagonal / 2)
            images = pose_vectors(placed.poses[there] @ kind.symmetries, kind.diagonal / 2)
            assert np.linalg.norm(images - reached, axis=1).min() <= space.kit.pose_tolerance
        assert cycles == 2 * (len(assembly.edges) - len(assembly) + 1) > 0


def test_mirrored_parts_are_one_type_in_kits_that_merge_them() -> None:
    mirror = np.diag([-1.0, 1, 1, 1])
    meshes = {"plain": box(1, 1, 1), "arrow": with_arrow(box(1, 1, 1))}
    parts: list[Placed] = [*cubes((0, 0, 0), (1, 0, 0), (1, 1, 0)), ("arrow", pose(0, 1, 0) @ mirror)]
    kit = toy_kit(meshes, [parts, cubes((0, 0, 0), (0, 1, 0))], mirror_images_match=True)
    assert min(np.linalg.det(pose[:3, :3]) for pose in kit.exemplars[0].assembly.poses) < 0
    space = CategorySpace(kit)
    for exemplar in kit.exemplars:
        for encoded in strings_of(space, exemplar.assembly, "all", 4, 0):
            assert_comes_back(space, exemplar.assembly, encoded)


def test_a_single_part_has_the_category_of_its_type() -> None:
    space = space_of("cubes")
    assembly = space.kit.exemplars[0].assembly
    for kind in range(2):
        part = int(np.flatnonzero(assembly.types == kind)[0])
        (encoded,) = strings_of(space, assembly.select(np.array([part])), "all", 0, 0)
        assert assert_comes_back(space, assembly.select(np.array([part])), encoded) == [1 + kind]
        assert list(space.categories_between(None, kind)) == [1 + kind]


def test_categories_of_a_neighbor_depend_on_type_and_label() -> None:
    space = space_of("castle")
    for (a, b), pair in space.pairs.items():
        beside = space.categories_between(a, b)  # each type of this kit has a label of its own
        assert beside == range(pair.first, pair.first + len(pair.poses))
        assert all(space.types[category].tolist() == [a, b] for category in beside)
    assert space.categories_between(0, 0) == range(0), "a tower's base does not stand on another"
    assert sum(len(pair.poses) for pair in space.pairs.values()) == len(space) - 1 - len(space.kit.types)


def test_unseen_relative_poses_have_no_category() -> None:
    space = roads()
    assembly = space.kit.exemplars[0].assembly
    (encoded,) = strings_of(space, assembly, "all", 0, 0)
    poses = assembly.poses.copy()
    poses[0, 1, 3] += 5 * space.kit.pose_tolerance
    with pytest.raises(NoCategoryError, match=r"(post and rod|rod and post) have a relative pose"):
        space.label(Assembly(assembly.types, poses, assembly.edges), [encoded])


def test_categories_of_other_tokens_are_rejected() -> None:
    space = roads()
    right = labelled(space, space.kit.exemplars[0].assembly, Encoded("ABABA", np.array([0, 3, 1, 4, 2])))
    for changed, said in (
        (right[:-1], "5 tokens have 4 categories"),
        ([*right[:-1], right[1]], "token 4 has category"),
        ([2, *right[1:]], "token 0 has category 2"),
        ([*right[:-1], DUMMY_CATEGORY], "token 4 has category 0"),
        ([*right[:-1], len(space)], "token 4 has category"),
    ):
        with pytest.raises(ValueError, match=said):
            space.place("ABABA", changed)


@pytest.mark.slow
def test_parts_with_equal_labels_are_rebuilt_with_their_own_surface(tmp_path: Path) -> None:
    shapes = tuple(ShapeFile(path=path) for path in write_chairs(tmp_path, 4))
    kit = read_kit(KitConfig(name="chairs", shapes=shapes, types="meaning").resolve(STRICTEST))
    space = CategorySpace(kit)
    assert len(kit.labels) < len(kit.types)
    for exemplar in kit.exemplars:
        for encoded in strings_of(space, exemplar.assembly, "all", 2, 0):
            categories = assert_comes_back(space, exemplar.assembly, encoded)
            decoded = decode(encoded.string, space.alphabet)
            for category, (here, there) in zip(categories, token_edges(decoded).tolist(), strict=True):
                if here >= 0:
                    parent = int(exemplar.assembly.types[encoded.nodes[here]])
                    assert category in space.categories_between(parent, int(decoded.types[there]))
