"""Stretched pieces: one affine map brings a piece to a gap of another size, and its contacts come along."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stages.package.glb import glb_bytes
from stages.shape.assembly_faults import geometry_faults
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.shape.shape import kit_shape
from stages.shape.stretch import moved_by
from stages.variations.requirements.stretched_contacts import broken_contact
from stages.variations.search.search import Search, Variant
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose, with_arrow

GATE = {
    "floor": with_arrow(box(12.0, 0.2, 3.0)),
    "post": with_arrow(box(0.5, 2.0, 0.5)),
    "bar": with_arrow(box(3.5, 0.5, 0.5)),
    "rail": with_arrow(box(2.25, 0.5, 0.5)),
    "knot": with_arrow(box(1.0, 0.5, 0.5)),
}


def gate(reach: float, *between: tuple[str, float]) -> list[Placed]:
    """Two posts so far apart on a floor, with what hangs between them."""
    posts = [("post", pose(x, 1.1, 0)) for x in (-reach, reach)]
    return [("floor", pose(0, 0, 0)), *posts, *((name, pose(x, 1.0, 0)) for name, x in between)]


@pytest.fixture(scope="module")
def kit() -> Kit:
    """A gate that a bar closes, and a wider one that two rails and a knot between them close."""
    return kit_of(GATE, [gate(2, ("bar", 0)), gate(3, ("rail", -1.625), ("knot", 0), ("rail", 1.625))])


def found_in(kit: Kit, **stretch: Any) -> tuple[Search, list[Variant]]:
    config = {"method": "substructures", "stretch": stretch}
    line = Search(ContactOracle(kit), SearchConfig.model_validate(config))
    return line, line.run(np.random.default_rng(0), 1500, 10**9, "test", lambda count: None)[0]


def named(kit: Kit, variant: Variant) -> list[str]:
    return sorted(kit.type_names()[each] for each in variant.assembly.types)


def test_a_piece_takes_the_place_of_a_longer_one_only_where_it_may_be_stretched(kit: Kit) -> None:
    rigid, none = found_in(kit)
    assert not none
    assert rigid.rejects["replaced: no embedding"]
    _, bent = found_in(kit, most=1.6)
    assert sorted(map(tuple, (named(kit, each) for each in bent))) == [
        ("bar", "floor", "post", "post"),
        ("floor", "knot", "post", "post", "rail", "rail"),
    ]
    contact = []
    for each in bent:
        assert each.lineage["deformed"]
        shape = kit_shape(kit, each.assembly)
        contact.append(ContactTest(shape.meshes, kit.contact_tolerance))
        touching = contact[-1].contacts(shape.assembly.types, shape.assembly.poses)
        np.testing.assert_array_equal(touching, each.assembly.edges)
    _, less = found_in(kit, most=1.2)
    assert not less


def test_what_is_stretched_is_verified_as_what_is_not(kit: Kit) -> None:
    """By the other contact test, from the mesh as it stands in the file; one that is moved or too long is found out."""
    _, bent = found_in(kit, most=1.6)
    for variant in bent:
        assert verified(kit, variant, np.eye(4)) == []
        longer = verified(kit, variant, np.diag([1.3, 1.0, 1.0, 1.0]))
        assert any("into each other" in each or "do not touch" in each for each in longer)


def verified(kit: Kit, variant: Variant, motion: np.ndarray) -> list[str]:
    """What is wrong with a packaged variant whose bar or knot was moved by an affine map."""
    at = next(place for place, each in enumerate(variant.assembly.types) if kit.type_names()[each] in ("bar", "knot"))
    motions = np.tile(np.eye(4), (len(variant.assembly), 1, 1))
    motions[at] = motion
    assembly = moved_by(variant.assembly, motions)
    assert (broken_contact(kit, assembly) is None) == np.array_equal(motion, np.eye(4))
    shape = kit_shape(kit, assembly)
    parts = [
        b'{"name": "%s", "pose": %s}' % (name.encode(), str(pose).encode())
        for name, pose in zip(shape.part_names, shape.placements.tolist(), strict=True)
    ]
    record = b'{"parts": [' + b", ".join(parts) + b"]}"
    return geometry_faults(kit, {"json": record, CONTACTS: pair_bytes(assembly.edges), "glb": glb_bytes(shape)})


def test_parts_that_are_to_stay_rigid_do(kit: Kit) -> None:
    """Rails are squeezed and a knot between them is not: it comes to stand in them, which is seen; a bar alone stays
    out."""
    line, found = found_in(kit, most=1.6, rigid=("knot", "bar"))
    assert not found
    assert line.rejects["stretched: parts clash"]
