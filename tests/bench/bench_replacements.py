"""How the time for listing all replacements grows with the graph: crops of real models, by dummy edges (substructures
§4.3)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stages.exemplars.build import build_kit
from stages.exemplars.read import read_model
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig, ShapeFile
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.answers import ContactAnswers
from stages.variations.substructures.operations import find_operations
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.sites import docking_graph
from tests.bench.measure import Measure

REAL = Path("../shared/exemplars")
MODELS = ("a12_dungeon_room_large", "a15_dungeon_full", "a17_temple_peripteros", "a25_dome")
SIZES = (20, 40, 70, 100, 150, 220, 350)


def bench() -> Iterator[Measure]:
    """Graphs of 70 parts, or all there are, a second; the note has seconds by size and the exponent of whole lists."""
    for name in MODELS if REAL.is_dir() else ():
        path = REAL / name / "model.glb"
        contact = ContactConfig(kinds=("point", "line", "face"))
        config = KitConfig(name="bench", shapes=(ShapeFile(path=path),), contact=contact)
        kit, _ = build_kit(config.decide(STRICTEST), [read_model(path)])
        graphs = [_crop(kit, kit.exemplars[0].assembly, size) for size in SIZES]
        graphs = [
            each for place, each in enumerate(graphs) if place == 0 or len(each.types) > len(graphs[place - 1].types)
        ]
        for dummies in (0, 1, 2):
            yield _growth(name.split("_")[0], graphs, dummies)


def _growth(name: str, graphs: list[OrderedGraph], dummies: int) -> Measure:
    seconds, is_whole, notes, at_70 = list[float](), list[bool](), list[str](), 0.0
    for graph in graphs:
        find_operations(graph, graph, dummies, by_docking=True)
        start = time.process_time()
        operations = find_operations(graph, graph, dummies, by_docking=True)
        seconds.append(max(time.process_time() - start, 1e-5))
        is_whole.append(operations.is_whole)
        cut = "" if operations.is_whole else ", cut short"
        notes.append(f"{len(graph.types)}: {len(operations):,} in {seconds[-1]:.3g} s{cut}")
        at_70 = seconds[-1] if len(graph.types) <= 70 else at_70
    sizes = np.log([len(each.types) for each in graphs])[is_whole]
    exponent = f"exponent {np.polyfit(sizes, np.log(seconds)[is_whole], 1)[0]:.2f}; " if sum(is_whole) > 2 else ""
    note = f"{exponent}{'; '.join(notes)}"
    return Measure(f"all replacements, growth, {name}, dummies {dummies}", "graphs", 1.0 / at_70, note=note)


def _crop(kit: Kit, assembly: Assembly, size: int) -> OrderedGraph:
    """The graph of the `size` parts that are met first, breadth first, from the part nearest to the middle."""
    places = assembly.poses[:, :3, 3]
    waiting = [int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmin())]
    neighbours, met = assembly.neighbours(), set(waiting)
    for part in waiting:
        fresh = [each for each in neighbours[part] if each not in met]
        met.update(fresh)
        waiting += fresh
    crop = assembly.select(np.array(sorted(waiting[:size])))
    labels = ContactAnswers(kit).dockings.label_edges(crop.types, crop.poses, crop.edges)
    return docking_graph(kit, crop, labels)
