"""Variants per second and core, and validations; the peer: FCL on all pairs with overlapping boxes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig, ShapeFile
from stages.shape.geometry.contact import overlapping_boxes, world_boxes
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.checks import validate
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import TRY_NUMBER
from stages.variations.kernels.variant_graph import place_boxes
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.search.draft import load_shape
from stages.variations.search.search import Search
from stages.variations.selection.shared_surface import PackedShapes
from stages.variations.settings import NoveltyConfig, SearchConfig
from stages.variations.substructures.docking_sites import docking_graph
from stages.variations.substructures.operations import find_operations
from tests.bench.measure import Measure, rate

SHIPPED_MODELS = Path("datasets/exemplars")
REAL_MODELS = Path("../shared/exemplars")
REAL_KITS: dict[str, tuple[str, ...]] = {
    "castle (a01+a02)": ("a01_castle_tower", "a02_castle_ground_floor"),
    "dungeon (a12+a13)": ("a12_dungeon_room_large", "a13_dungeon_junction"),
    "ring segments (a22+a23)": ("a22_ring_segment_10", "a23_ring_segment_13"),
    "race track (a06)": ("a06_racetrack",),
    "ball track (a08)": ("a08_ball_track",),
}


def bench() -> Iterator[Measure]:
    """New variants, counting rejected drafts; and validations."""
    folders = sorted(
        {shape.parent for shape in SHIPPED_MODELS.glob("*/*.glb")} - {SHIPPED_MODELS / "facade"}
    )  # one mesh
    shapes = {f"shipped {folder.name}": tuple(sorted(folder.glob("*.glb"))) for folder in folders}
    if REAL_MODELS.is_dir():
        shapes |= {
            name: tuple(REAL_MODELS / member / "model.glb" for member in members) for name, members in REAL_KITS.items()
        }
    for name, paths in shapes.items():
        kit = _kit(paths, ("face",) if "race" in name else ("point", "line", "face"))
        for guided in (False, True):
            novelty = NoveltyConfig(guided=guided)
            search = Search(ContactOracle(kit), SearchConfig(upright="ring" not in name, novelty=novelty))
            rng = np.random.default_rng(0)
            search.run(rng, 500, 10**9, "warm", lambda count: None)
            found: list[Assembly] = []
            ours = rate(partial(_some, search, rng, found), seconds=2.0, rounds=2)
            tries = len(found) + sum(search.rejects.values())
            label = "guided" if guided else "plain"
            yield Measure(f"new variants, {name}, {label}", "variants", ours, note=f"{len(found) / tries:.0%} of tries")
        yield from _operations(name, kit, search)
        if "castle" in name or "dungeon" in name:
            yield _validation(name, kit, search, found[-20:])
            yield _relatives(name, kit, found[-200:])
            yield _copied(name, search, found[-20:])


def _operations(name: str, kit: Kit, search: Search) -> Iterator[Measure]:
    """Graphs whose replacements are listed, without dummy edges and with one."""
    largest = max(kit.exemplars, key=lambda exemplar: len(exemplar.assembly)).assembly
    labels = search.oracle.dockings.label_edges(largest.types, largest.poses, largest.edges)
    graph = docking_graph(kit, largest, labels)
    for dummy_edges in (0, 1):
        count = len(find_operations(graph, graph, dummy_edges, by_docking=True))

        def graphs(dummy_edges: int = dummy_edges) -> int:
            find_operations(graph, graph, dummy_edges, by_docking=True)
            return 1

        note = f"{count} in {len(largest)} parts, {len(largest.edges)} contacts"
        yield Measure(f"all replacements, {name}, dummies {dummy_edges}", "graphs", rate(graphs, 1.0, 2), note=note)


def _some(search: Search, rng: np.random.Generator, found: list[Assembly]) -> int:
    new, _ = search.run(rng, 200, 10**9, "bench", lambda count: None)
    found.extend(variant.assembly for variant in new)
    return len(new)


def _kit(paths: tuple[Path, ...], kinds: tuple[Any, ...]) -> Kit:
    config = KitConfig(
        name="bench", shapes=tuple(ShapeFile(path=path) for path in paths), contact=ContactConfig(kinds=kinds)
    ).resolve(STRICTEST)
    kit, _ = build_kit(config, [read_parts(path) for path in paths])
    return kit


def _relatives(name: str, kit: Kit, assemblies: list[Assembly]) -> Measure:
    """Pairs of variants, compared for four fifths of shared surface."""
    shapes, everything = PackedShapes(kit, assemblies, upright=True), np.arange(len(assemblies))
    queries = cycle(everything.tolist())

    def pairs() -> int:
        shapes.shares(next(queries), everything, 0.8, 0.8)
        return len(everything)

    parts = int(np.mean([len(assembly) for assembly in assemblies]))
    return Measure(f"near relatives, {name}", "pairs", rate(pairs, 1.5, 2), note=f"{parts} parts")


def _copied(name: str, search: Search, assemblies: list[Assembly]) -> Measure:
    """Variants, searched for copied pieces."""
    test, table = CopyDetector(search.kit, search.oracle.dockings), search.oracle.dockings
    labelled = cycle([(item, table.label_edges(item.types, item.poses, item.edges)) for item in assemblies])

    def variant() -> int:
        test.copied(*next(labelled))
        return 1

    parts = int(np.mean([len(assembly) for assembly in assemblies]))
    return Measure(f"copied whole, {name}", "variants", rate(variant, 1.5, 2), note=f"{parts} parts")


def _validation(name: str, kit: Kit, search: Search, assemblies: list[Assembly]) -> Measure:
    """The whole shape graph of a variant from its poses, including the broad phase; FCL does not pay for its own."""
    import fcl

    models = []
    for part in kit.types:
        model = fcl.BVHModel()
        model.beginModel(len(part.vertices), len(part.faces))
        model.addSubModel(part.vertices, part.faces)
        model.endModel()
        models.append(model)
    cases = []
    for assembly in assemblies:
        bodies = [
            fcl.CollisionObject(models[index], fcl.Transform(pose[:3, :3], pose[:3, 3]))
            for index, pose in zip(assembly.types, assembly.poses, strict=True)
        ]
        boxes = world_boxes(kit.types, assembly.types, assembly.poses)
        cases.append((bodies, overlapping_boxes(boxes, kit.contact_tolerance).tolist()))

    def with_fcl() -> int:
        for bodies, pairs in cases:
            for i, j in pairs:
                if not fcl.collide(bodies[i], bodies[j], fcl.CollisionRequest(), fcl.CollisionResult()):
                    fcl.distance(bodies[i], bodies[j], fcl.DistanceRequest(), fcl.DistanceResult())
        return len(cases)

    parents = [search.parent("bench", item, np.zeros(len(item), dtype=np.int8), (0, 0)) for item in assemblies]
    ws, tables = search.maker.ws, search.maker.tables

    def ours() -> int:
        for parent in parents:
            n, shape = len(parent.assembly), parent.tables
            load_shape(search.maker.ws, parent)
            ws.rotations[:n], ws.translations[:n] = shape.rotations, shape.translations
            place_boxes(tables.boxes, ws.types, ws.rotations, ws.translations, n, ws.boxes)
            ws.counts[TRY_NUMBER] += 1
            i, j = parent.assembly.edges.T
            ws.stamp[i, j] = ws.stamp[j, i] = ws.counts[TRY_NUMBER]
            assert validate(tables, search.oracle.table, ws) == Outcome.OK
        return len(parents)

    parts = int(np.mean([len(assembly) for assembly in assemblies]))
    return Measure(
        f"validation of a variant, {name}", "variants", rate(ours, 1.5, 2), "FCL, overlapping boxes",
        rate(with_fcl, 1.5, 2), f"{parts} parts",
    )  # fmt: skip
