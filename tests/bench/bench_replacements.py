"""The time to list all replacements, by size of the graph, in crops of real models.

Replacements are operations by count of dummy edges (substructures §4.3), and moves along rigid motions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig, ShapeFile
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.variations.substructures.alignments import find_region_swaps
from stages.variations.substructures.docking_sites import docking_graph
from stages.variations.substructures.operations import Operations, find_operations
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.region_swaps import RegionSwaps
from tests.bench.measure import Measure

REAL_MODELS = Path("../shared/exemplars")
MODELS = ("a12_dungeon_room_large", "a15_dungeon_full", "a17_temple_peripteros", "a25_dome")
CROP_SIZES = (20, 40, 70, 100, 150, 220, 350)
ANY_WAY = -1
"""Motions need not be upright: the dome has another up axis than the others."""

Crop = tuple[Assembly, OrderedGraph]


def bench() -> Iterator[Measure]:
    """Graphs of 70 parts, or of all parts, per second; the note has seconds by size and the exponent of full lists."""
    for name in MODELS if REAL_MODELS.is_dir() else ():
        path = REAL_MODELS / name / "model.glb"
        contact = ContactConfig(kinds=("point", "line", "face"))
        config = KitConfig(name="bench", shapes=(ShapeFile(path=path),), contact=contact)
        kit, _ = build_kit(config.resolve(STRICTEST), [read_parts(path)])
        whole = kit.exemplars[0].assembly
        crops = [_crop(kit, whole, size) for size in sorted({min(size, len(whole)) for size in CROP_SIZES})]
        short = name.split("_")[0]
        for dummy_edges in (0, 1, 2):
            yield _growth(
                f"all replacements, growth, {short}, dummies {dummy_edges}", crops, partial(_operations, dummy_edges)
            )
        yield _growth(f"all replacements, growth, {short}, moves", crops, partial(_moves, kit))


def _operations(dummy_edges: int, crop: Crop) -> Operations:
    return find_operations(crop[1], crop[1], dummy_edges, by_docking=True)


def _moves(kit: Kit, crop: Crop) -> RegionSwaps:
    return find_region_swaps(kit, ANY_WAY, crop, crop)


def _growth(name: str, crops: Sequence[Crop], listed: Callable[[Crop], Operations | RegionSwaps]) -> Measure:
    seconds, is_whole, notes, at_70 = list[float](), list[bool](), list[str](), 0.0
    for crop in crops:
        listed(crop)
        start = time.process_time()
        found = listed(crop)
        seconds.append(max(time.process_time() - start, 1e-5))
        is_whole.append(found.is_whole)
        cut = "" if found.is_whole else ", cut short"
        notes.append(f"{len(crop[0])}: {len(found):,} in {seconds[-1]:.3g} s{cut}")
        at_70 = seconds[-1] if len(crop[0]) <= 70 else at_70
    sizes = np.log([len(assembly) for assembly, _ in crops])[is_whole]
    exponent = f"exponent {np.polyfit(sizes, np.log(seconds)[is_whole], 1)[0]:.2f}; " if sum(is_whole) > 2 else ""
    return Measure(name, "graphs", 1.0 / at_70, note=f"{exponent}{'; '.join(notes)}")


def _crop(kit: Kit, assembly: Assembly, size: int) -> Crop:
    """Return the first `size` parts, breadth first from the part nearest to the middle, and their graph."""
    places = assembly.poses[:, :3, 3]
    waiting = [int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmin())]
    neighbours, met = assembly.neighbours(), set(waiting)
    for part in waiting:
        fresh = [neighbour for neighbour in neighbours[part] if neighbour not in met]
        met.update(fresh)
        waiting += fresh
    crop = assembly.select(np.array(sorted(waiting[:size])))
    labels = ContactOracle(kit).dockings.label_edges(crop.types, crop.poses, crop.edges)
    return crop, docking_graph(kit, crop, labels)
