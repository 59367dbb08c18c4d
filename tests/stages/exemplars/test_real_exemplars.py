"""Contact graphs and part types of public models, compared with measurements by other tools."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig
from stages.shape.kit import ContactKind, Kit

EXEMPLARS = Path(__file__).resolve().parents[4] / "shared" / "exemplars"
FOLDERS = sorted(path.parent for path in EXEMPLARS.glob("[ah]*/exemplar.json"))
TOLERANCES = {"h01": 5e-3, "h03": 5e-3, "h04": 1e-2, "h06": 1e-2, "h09": 1e-2, "h10": 2e-3}
"""Contact tolerances with which the edges of `exemplar.json` were measured, if not 1e-3 of the median diagonal."""
ALL_KINDS: tuple[ContactKind, ...] = ("point", "line", "face")

MIRRORED = {"a08": 1, "h06": 3}
"""Pairs of types that are mirror images; `types_by_geometry` counts them as one type."""
DOUBLED = {"a05": ["Wall3WindowGrate.002", "Wall3WindowGrate.003"], "a11": ["wall_empty.019", "roof_tile_empty.041"]}
"""Models with coincident parts, which are left out here and present in the measurements."""
PRINTED = {"a17": 1}
"""The printed tile has the surface of the plain tile with other triangles, so both are one type."""

pytestmark = pytest.mark.skipif(not FOLDERS, reason="the public exemplars are not next to the project")


@cache
def build(folder: Path, mirrored: bool = False, kinds: tuple[ContactKind, ...] = ALL_KINDS) -> Kit:
    path = folder / "model.glb"
    contact = ContactConfig(tolerance=TOLERANCES.get(folder.name[:3], 1e-3), kinds=kinds)
    config = KitConfig(name="real", shapes=(path,), parts="nodes", contact=contact, mirror_images_match=mirrored)
    return build_kit(config.resolve(STRICTEST), [read_parts(path, "nodes")])[0]


def measured(folder: Path) -> dict[str, Any]:
    """Return the measurements of a model without its coincident parts."""
    described: dict[str, Any] = json.loads((folder / "exemplar.json").read_text(encoding="utf-8"))
    doubled = DOUBLED.get(folder.name[:3], [])
    keep = [index for index, part in enumerate(described["part_list"]) if part["node"] not in doubled]
    place = {index: number for number, index in enumerate(keep)}
    described["part_list"] = [described["part_list"][index] for index in keep]
    described["edge_list"] = [
        [place[edge[0]], place[edge[1]], *edge[2:]]
        for edge in described["edge_list"]
        if edge[0] in place and edge[1] in place
    ]
    return described


def edges(kit: Kit) -> list[list[int]]:
    contacts: list[list[int]] = kit.exemplars[0].assembly.edges.tolist()
    return contacts


def pairs(listed: list[list[Any]]) -> list[list[int]]:
    return sorted(sorted(pair[:2]) for pair in listed)


def folder_of(prefix: str) -> Path:
    return next(folder for folder in FOLDERS if folder.name.startswith(prefix))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_contacts_and_part_types_are_those_measured_with_fcl(folder: Path) -> None:
    kit, truth = build(folder), measured(folder)
    assert list(kit.exemplars[0].part_names) == [part["node"] for part in truth["part_list"]]
    assert edges(kit) == pairs(truth["edge_list"])
    short = folder.name[:3]
    assert len(kit.types) == truth["types_by_geometry"] + MIRRORED.get(short, 0) - PRINTED.get(short, 0)
    if truth["types_by_geometry"] == truth["types"] and short not in PRINTED:
        by_name = Counter(part["type"] for part in truth["part_list"])
        by_type = Counter(kit.exemplars[0].assembly.types.tolist())
        assert sorted(by_name.values()) == sorted(by_type.values())
        both = {
            (part["type"], int(index))
            for part, index in zip(truth["part_list"], kit.exemplars[0].assembly.types, strict=True)
        }
        assert len(both) == len(kit.types), "parts of one mesh are one type, and of two meshes are two"


@pytest.mark.parametrize("short", sorted(MIRRORED))
def test_mirror_images_are_one_type_only_if_the_config_says_so(short: str) -> None:
    folder = folder_of(short)
    assert len(build(folder, mirrored=True).types) == measured(folder)["types_by_geometry"]


def test_printed_tile_of_the_temple_is_the_plain_one_in_other_triangles() -> None:
    folder = folder_of("a17")
    kit = build(folder)
    types = {
        part["type"]: index
        for part, index in zip(measured(folder)["part_list"], kit.exemplars[0].assembly.types, strict=True)
    }
    assert types["4162"] == types["4162p0x"]
    parts = {part.mesh_name: part for part in read_parts(folder / "model.glb").parts}
    plain, printed = parts["4162"], parts["4162p0x"]
    np.testing.assert_allclose(np.ptp(plain.vertices, axis=0), np.ptp(printed.vertices, axis=0), atol=1e-5)
    assert len(plain.faces) != len(printed.faces)


@pytest.mark.parametrize("short", ["a24", "a25"])
def test_masonry_has_the_interfaces_of_its_authors(short: str) -> None:
    folder = folder_of(short)
    assert edges(build(folder)) == pairs(measured(folder)["author_interface_graph"])


def test_cross_vault_has_the_interfaces_of_its_authors_where_faces_count() -> None:
    folder = folder_of("a26")
    contacts = edges(build(folder, kinds=("face",)))
    assert contacts == pairs(measured(folder)["author_interface_graph"])
    assert len(contacts) == 452


def test_race_track_is_one_loop_where_faces_count() -> None:
    kit = build(folder_of("a06"), kinds=("face",))
    degrees = Counter(part for edge in edges(kit) for part in edge)
    assert len(edges(kit)) == 16
    assert set(degrees.values()) == {2}
