"""Chairs of a program, exported and taken apart by meaning: what is put together stands and is what its record says."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.package.glb import glb_bytes
from stages.package.record import describe_sample
from stages.shape.assembly_faults import geometry_faults
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Kit
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.sample import Sample
from stages.shape.shape import kit_shape
from stages.strings.encoder import canonical_string
from stages.strings.tokens import make_alphabet
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from tests.stages.strings.grammar_check import check_string
from tests.toy_kits.program_chairs import write_chairs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Kit:
    shapes = tuple(ShapeFile(path=path) for path in write_chairs(tmp_path_factory.mktemp("chairs"), 6))
    return read_kit(KitConfig(name="chairs", shapes=shapes, types="meaning").resolve(STRICTEST))


@pytest.fixture(scope="module")
def found(kit: Kit) -> list[Variant]:
    line = Search(ContactOracle(kit), SearchConfig())
    return line.run(np.random.default_rng(0), 4000, 60, "test", lambda count: None)[0]


def test_legs_backs_and_arms_are_exchanged_within_their_labels(kit: Kit, found: list[Variant]) -> None:
    assert {"seat", "leg", "back_post", "arm"} <= set(kit.labels) < set(kit.type_names())
    assert len(found) == 60
    assert {variant.lineage["method"] for variant in found} == {"exchange", "substitution"}
    legs = {
        tuple(sorted(kit.types[part].name for part in variant.assembly.types if kit.types[part].label == "leg"))
        for variant in found
    }
    assert len(legs) > 6


def test_assembled_chairs_stand_like_their_parents(kit: Kit, found: list[Variant]) -> None:
    shapes = [*(exemplar.assembly for exemplar in kit.exemplars), *(variant.assembly for variant in found[::4])]
    for assembly in shapes:
        shape = kit_shape(kit, assembly)
        validity = Judge(shape.meshes, shape.up, PhysicsConfig()).validity(shape.assembly)
        assert validity.rooted
        assert validity.stable


def test_independent_verification_finds_no_fault(kit: Kit, found: list[Variant]) -> None:
    alphabet = make_alphabet(kit.labels)
    for variant in found[::6]:
        shape, contacts = kit_shape(kit, variant.assembly), pair_bytes(variant.assembly.edges)
        sample = Sample("chair-0", "train", "variations", "chairs", "0" * 64, {}, variant.assembly)
        record = describe_sample(sample, "kit", shape, {CONTACTS: contacts, "txt": b"A\n"}, {})
        members = {"json": json.dumps(record).encode(), CONTACTS: contacts, "glb": glb_bytes(shape)}
        assert geometry_faults(kit, members) == []
        labelled = kit.labelled(variant.assembly)
        encoded = canonical_string(labelled.types, labelled.edges, alphabet)
        decoded = check_string(encoded.string, alphabet, kit.grammar)
        assert graph_digest(decoded.types, decoded.edges) == graph_digest(labelled.types, labelled.edges)
