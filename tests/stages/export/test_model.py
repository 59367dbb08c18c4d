"""Links and joints of shapes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from stages.export.hulls import convex_piece
from stages.export.model import simulation_model
from stages.export.settings import ExportSettings
from stages.shape.geometry.bounds import shape_bounds
from tests.stages.export.models import cabinet, cabinet_model, mesh, two_pieces


def test_drawers_and_doors_move_with_their_handles_against_the_case() -> None:
    model = cabinet_model(ExportSettings(links="bodies"))
    names = [[model.shape.part_names[part].partition(".")[0] for part in link.parts] for link in model.links]
    assert [sorted(own) for own in names[1:]] == [["drawer", "handle"], ["drawer", "handle"], ["door", "handle"]]
    assert [(joint.kind, joint.parent) for joint in model.joints] == [
        ("prismatic", 0),
        ("prismatic", 0),
        ("revolute", 0),
    ]
    assert model.joints[0].axis.tolist() == [0.0, -1.0, 0.0], (
        "a drawer comes out to the front, which is -y of a z-up world"
    )
    assert model.joints[0].upper == pytest.approx(0.8 * 0.45)


def test_links_of_parts_are_a_tree_with_the_mass_of_the_bodies() -> None:
    parts, bodies = (cabinet_model(ExportSettings(links=links)) for links in ("parts", "bodies"))
    assert len(parts.links) == len(cabinet()) == len(parts.joints) + 1
    assert sum(link.mass for link in parts.links) == pytest.approx(sum(link.mass for link in bodies.links))
    assert sorted(joint.child for joint in parts.joints) == list(range(1, len(parts.links)))
    assert all(joint.parent < joint.child for joint in parts.joints)


def test_the_lowest_point_is_at_height_0_and_scale_is_metres_a_unit() -> None:
    shape, pairs = two_pieces()
    model = simulation_model("two", shape, pairs, ExportSettings(scale=0.1, density=1000.0))
    low, high = shape_bounds(model.shape)
    assert low[2] == pytest.approx(0.0)
    assert high[2] == pytest.approx(0.12)
    assert len(model.roots) == 2, "pieces apart are bodies of their own"
    assert sum(link.mass for link in model.links) == pytest.approx(1.0 + 1.0 + 0.8)


def test_a_flat_part_gets_a_hull_with_a_volume() -> None:
    square = trimesh.Trimesh([(0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)], [(0, 1, 2), (0, 2, 3)], process=False)
    hull = convex_piece(mesh("sheet", square))
    assert trimesh.Trimesh(hull.vertices, hull.faces).volume == pytest.approx(2 * 2e-4, rel=1e-3)


def test_a_hull_holds_every_vertex_of_its_part() -> None:
    ring = mesh("ring", trimesh.creation.annulus(0.4, 0.9, 0.6, sections=11))
    hull = convex_piece(ring)
    solid = trimesh.Trimesh(hull.vertices, hull.faces)
    assert solid.is_watertight
    assert solid.is_convex
    assert solid.volume > 0
    assert np.isin(hull.vertices.round(9), ring.vertices.round(9)).all()
