"""Properties of the shipped kits, measured with FCL and trimesh instead of the project's own contact test."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import combinations
from pathlib import Path

import fcl
import networkx as nx
import numpy as np
import pytest
import trimesh

from shipped_kits.catalogue import KITS, write_kits
from shipped_kits.kit_shape import KitShape
from stages.exemplars.congruence import comparable_mesh, congruences
from stages.shape.arrays import FloatArray, IntArray

COMMITTED = Path(__file__).parents[2] / "datasets" / "exemplars"


@cache
def kit_shapes(kit: str) -> dict[str, KitShape]:
    return KITS[kit]()


@cache
def part_mesh(kit: str, name: str) -> tuple[FloatArray, IntArray]:
    """Return vertices merged by position, as a reader of the file merges them."""
    solid = next(iter(kit_shapes(kit).values())).types[name]
    vertices, faces, _ = solid.mesh()
    distinct, inverse = np.unique(vertices.astype(np.float32), axis=0, return_inverse=True)
    return distinct.astype(np.float64), inverse[faces].astype(np.int32)


@cache
def shape_graph(kit: str, shape: str) -> tuple[nx.Graph, float, list[float]]:
    """Return the contact graph with types as node attributes, the tolerance, and distances of other pairs."""
    placed = kit_shapes(kit)[shape].placed
    diagonals = [float(np.linalg.norm(np.ptp(part_mesh(kit, name)[0], axis=0))) for name, _ in placed]
    tolerance = 1e-3 * float(np.median(diagonals))
    objects, boxes = [], []
    for name, pose in placed:
        vertices, faces = part_mesh(kit, name)
        model = fcl.BVHModel()
        model.beginModel(len(vertices), len(faces))
        model.addSubModel(vertices, faces)
        model.endModel()
        objects.append(fcl.CollisionObject(model, fcl.Transform(pose[:3, :3], pose[:3, 3])))
        moved = vertices @ pose[:3, :3].T + pose[:3, 3]
        boxes.append((moved.min(axis=0), moved.max(axis=0)))
    graph, gaps = nx.Graph(), []
    for index, (name, _) in enumerate(placed):
        graph.add_node(index, type=name)
    for i, j in combinations(range(len(placed)), 2):
        if max((boxes[i][0] - boxes[j][1]).max(), (boxes[j][0] - boxes[i][1]).max()) > 12 * tolerance:
            continue
        if fcl.collide(objects[i], objects[j], fcl.CollisionRequest(), fcl.CollisionResult()):
            gap = 0.0
        else:
            gap = fcl.distance(objects[i], objects[j], fcl.DistanceRequest(), fcl.DistanceResult())
        if gap <= tolerance:
            graph.add_edge(i, j)
        else:
            gaps.append(gap)
    return graph, tolerance, gaps


def neighbourhoods(graph: nx.Graph) -> set[tuple[str, tuple[tuple[str, int], ...]]]:
    """Return the type of each part with the multiset of its neighbours' types."""
    types = nx.get_node_attributes(graph, "type")
    return {(types[i], tuple(sorted(Counter(types[j] for j in graph[i]).items()))) for i in graph}


PARTS = [(kit, name) for kit in KITS for name in next(iter(kit_shapes(kit).values())).types]
SHAPES = [(kit, shape) for kit in KITS for shape in kit_shapes(kit)]


@pytest.mark.parametrize(("kit", "name"), PARTS)
def test_every_shell_of_a_part_is_closed_and_right_side_out(kit: str, name: str) -> None:
    vertices, faces = part_mesh(kit, name)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert 50 <= len(faces) <= 2000
    assert mesh.area_faces.min() > 1e-7
    shells = mesh.split(only_watertight=False)
    for shell in shells:
        assert shell.is_watertight
        assert shell.is_winding_consistent
        assert shell.volume > 0


@pytest.mark.parametrize(("kit", "name"), PARTS)
def test_no_part_equals_itself_upside_down_or_on_its_side(kit: str, name: str) -> None:
    own = comparable_mesh(*part_mesh(kit, name))
    for transform in congruences(own, own, 1e-3, reflections=False):
        assert transform[:3, 1] == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)


@pytest.mark.parametrize(("kit", "shape"), SHAPES)
def test_a_shape_is_one_piece_with_loops_and_branches_and_no_hub(kit: str, shape: str) -> None:
    graph, _, _ = shape_graph(kit, shape)
    assert 25 <= len(graph) <= 90
    assert nx.is_connected(graph)
    assert graph.number_of_edges() - len(graph) + 1 >= 3
    assert nx.has_bridges(graph)
    assert max(degree for _, degree in graph.degree) <= 12


@pytest.mark.parametrize(("kit", "shape"), SHAPES)
def test_parts_touch_or_keep_a_clear_distance(kit: str, shape: str) -> None:
    _, tolerance, gaps = shape_graph(kit, shape)
    assert min(gaps, default=np.inf) >= 10 * tolerance


@pytest.mark.parametrize("kit", KITS)
def test_two_shapes_share_most_types_and_have_own_neighbourhoods(kit: str) -> None:
    (_, first), (_, second) = ((shape, shape_graph(kit, shape)[0]) for shape in kit_shapes(kit))
    types = [set(nx.get_node_attributes(graph, "type").values()) for graph in (first, second)]
    all_types = types[0] | types[1]
    assert len(all_types) >= 8
    assert len(types[0] & types[1]) >= 0.6 * len(all_types)
    assert all_types == set(next(iter(kit_shapes(kit).values())).types)
    seen = neighbourhoods(first), neighbourhoods(second)
    assert seen[0] & seen[1]
    assert seen[0] - seen[1]
    assert seen[1] - seen[0]


def test_committed_files_equal_those_of_the_code(tmp_path: Path) -> None:
    written = {path.relative_to(tmp_path): path.read_bytes() for path in write_kits(tmp_path)}
    committed = {path.relative_to(COMMITTED): path.read_bytes() for path in sorted(COMMITTED.rglob("*.glb"))}
    assert sorted(written) == sorted(committed)
    assert [path for path in written if written[path] != committed[path]] == []
    assert sum(map(len, committed.values())) < 1_500_000
