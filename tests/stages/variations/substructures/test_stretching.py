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
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
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
    return sorted(kit.type_names()[part_type] for part_type in variant.assembly.types)


def test_piece_replaces_a_longer_one_only_if_stretched(kit: Kit) -> None:
    rigid, none = found_in(kit)
    assert not none
    assert rigid.rejects["replaced: no embedding"]
    _, bent = found_in(kit, max_factor=1.6)
    assert sorted(map(tuple, (named(kit, entry) for entry in bent))) == [
        ("bar", "floor", "post", "post"),
        ("floor", "knot", "post", "post", "rail", "rail"),
    ]
    contact = []
    for entry in bent:
        assert entry.lineage["deformed"]
        shape = kit_shape(kit, entry.assembly)
        contact.append(ContactTest(shape.meshes, kit.contact_tolerance))
        touching = contact[-1].contacts(shape.assembly.types, shape.assembly.poses)
        np.testing.assert_array_equal(touching, entry.assembly.edges)
    _, less = found_in(kit, max_factor=1.2)
    assert not less


def test_stretched_variants_pass_verification(kit: Kit) -> None:
    """By the other contact test, from the mesh as it stands in the file; one that is moved or too long is found out."""
    _, bent = found_in(kit, max_factor=1.6)
    for variant in bent:
        assert verified(kit, variant, np.eye(4)) == []
        longer = verified(kit, variant, np.diag([1.3, 1.0, 1.0, 1.0]))
        assert any("into each other" in entry or "do not touch" in entry for entry in longer)


def verified(kit: Kit, variant: Variant, motion: np.ndarray) -> list[str]:
    """What is wrong with a packaged variant whose bar or knot was moved by an affine map."""
    at = next(
        place
        for place, part_type in enumerate(variant.assembly.types)
        if kit.type_names()[part_type] in ("bar", "knot")
    )
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


def test_rigid_parts_keep_their_size(kit: Kit) -> None:
    """Rails are squeezed and a knot between them is not: it comes to stand in them, which is seen; a bar alone stays
    out."""
    line, found = found_in(kit, max_factor=1.6, rigid=("knot", "bar"))
    assert not found
    assert line.rejects["stretched: parts clash"]
