"""Compare replaceable substructures with exchange on families of real models, in equal CPU time (substructures §6).

python -m tests.bench.families [--seconds 8] [--sheets DIR] [FAMILY...]

Models are read from ../shared, next to the project; a program makes ten chairs. Prints two
Markdown tables: what can be replaced between the exemplars, and what searches find of it. CPU seconds of one process.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement, product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pipeline.paths import write_file
from stages.autoconfig.trial_search import type_counts
from stages.exemplars.build import build_kit, read_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.inspection.sample_figure import MAX_SHAPES_SHOWN, ShownShape, ShownShapes, sample_figure
from stages.programs.files import named_values, shape_glb
from stages.programs.program import find_program
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.shape import kit_shape
from stages.variations.constraint import build_test
from stages.variations.novelty.features import AXES, MIN_MIXTURE
from stages.variations.selection.farthest_first import farthest_first
from stages.variations.settings import SearchConfig, StretchConfig, VariantRequirements
from stages.variations.substructures.alignments import find_region_swaps
from stages.variations.substructures.docking_sites import docking_graph
from stages.variations.substructures.operations import find_operations
from tests.bench.furniture import FURNITURE, PATTERNS_BY_MEANING, side_by_side
from tests.bench.variety import Finds, configured, explore

REAL = Path("../shared/exemplars")
Family = tuple[Kit, SearchConfig]

LISTED = (
    "| family | parts | moves | normalised | by order | normalised | with dummy edges |\n"
    "|---|---:|---:|---:|---:|---:|---:|"
)
FOUND = (
    "| family | search | tries | known | too few or many parts | not embedded | clash | grammar | in the air | other "
    "| shapes | held up | stand | graphs | histograms | mixed | copied |\n"
    "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
)
REASONS = {
    "known": ("duplicate",),
    "size": ("too few parts", "too many parts"),
    "not embedded": ("no embedding", "nothing but a gap to close", "at other angles", "not matched", "missing", "took"),
    "clash": ("clash",),
    "grammar": ("grammar",),
    "in the air": ("lifted", "not held"),
}
"""Words of the search's reasons for a reject, by column."""

MAX_SHAPES_TESTED = 300
"""Shapes that are tested for supported parts and for stability."""


def _real(*folders: str, grammar: str = "multiset", up: str = "y") -> Family:
    paths = tuple(ShapeFile(path=REAL / folder / "model.glb") for folder in folders)
    chosen = {**STRICTEST, "grammar": grammar, "up": up}
    return read_kit(KitConfig(name="family", shapes=paths).resolve(chosen)), SearchConfig(duplicates="graph")


def _dungeon() -> Family:
    return _real("a12_dungeon_room_large", "a13_dungeon_junction", "a15_dungeon_full", grammar="count_and_pairs")


def _vault() -> Family:
    return _real("a26_crossvault", grammar="count_and_pairs", up="z")


def _furniture() -> Family:
    """Return a kit with types by meaning, stretched at most fourfold."""
    paths = [REAL / folder / "model.glb" for folder in FURNITURE]
    config = KitConfig(
        name="furniture",
        shapes=tuple(ShapeFile(path=path) for path in paths),
        types="meaning",
        label_map=PATTERNS_BY_MEANING,
    )
    chosen = {
        **STRICTEST,
        "up": "z",
        "grammar": "count_and_types",
        "contact.tolerance": 0.02,
        "disconnected": "largest",
    }
    kit, _ = build_kit(config.resolve(chosen), side_by_side([read_parts(path) for path in paths]))
    return kit, SearchConfig(duplicates="graph", min_size=0.5, stretch=StretchConfig(max_factor=4.0))


def _chairs() -> Family:
    program = find_program("chair")
    with TemporaryDirectory() as folder:
        paths = [
            write_file(Path(folder) / f"{seed}.glb", shape_glb(program, named_values(program, str(seed))))
            for seed in range(1, 11)
        ]
        config = KitConfig(name="chairs", shapes=tuple(ShapeFile(path=path) for path in paths), types="meaning")
        kit = read_kit(config.resolve({**STRICTEST, "contact.tolerance": 0.01}))
    return kit, SearchConfig(duplicates="graph")


FAMILIES: dict[str, Callable[[], Family]] = {
    "dungeon": _dungeon,
    "castle": lambda: configured("castle"),
    "bridge": lambda: configured("bridge"),
    "temple": lambda: configured("temple"),
    "ring": lambda: configured("ring-segments"),
    "crossvault": _vault,
    "space base": lambda: configured("default/space-base"),
    "space base hall": lambda: configured("spacebase-hall"),
    "furniture": _furniture,
    "chairs": _chairs,
}


def main() -> None:
    """List what can be replaced in every family, search it both ways, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.families", description="Replacements of real models.")
    parser.add_argument("families", nargs="*", help=f"families; all of {', '.join(FAMILIES)} if none is named")
    parser.add_argument("--seconds", type=float, default=8.0, help="CPU seconds of each search")
    parser.add_argument("--sheets", type=Path, metavar="DIR", help="draw the most different finds of each search there")
    asked = parser.parse_args()
    unknown = set(asked.families) - set(FAMILIES)
    if unknown:
        parser.error(f"there is no family {', '.join(sorted(unknown))}; families are {', '.join(FAMILIES)}")
    rows: list[str] = []
    print(LISTED, flush=True)
    for name in asked.families or FAMILIES:
        kit, config = FAMILIES[name]()
        print(_listed(name, kit, config), flush=True)
        for method in ("substructures", "exchange"):
            way = config.model_copy(update={"method": method})
            finds = explore(kit, way, asked.seconds, 0, shown=True)
            stable = _stable(kit, finds.kept[:MAX_SHAPES_TESTED])
            rows.append(_found(name, method, kit, finds, len(stable)))
            if asked.sheets and stable:
                lists = (
                    type_counts(kit, [assembly.types for assembly in shapes]) for shapes in (stable, _exemplars(kit))
                )
                chosen = farthest_first(*lists, min(MAX_SHAPES_SHOWN, len(stable))).tolist()
                shapes = [ShownShape(kit_shape(kit, stable[index])) for index in chosen]
                path = asked.sheets / f"{name.replace(' ', '-')}-{method}.png"
                write_file(path, sample_figure(kit, [ShownShapes("Most different finds", shapes, method)], name))
    print("\n".join(["", FOUND, *rows]))


def _exemplars(kit: Kit) -> list[Assembly]:
    return [exemplar.assembly for exemplar in kit.exemplars]


def _stable(kit: Kit, shapes: Sequence[Assembly]) -> list[Assembly]:
    """Return the stable shapes if the exemplars are stable, as `variations.require.stable: auto` does; else all."""
    physical = VariantRequirements().physical(stable=True)
    if any(unmet_requirement(physical, kit_shape(kit, exemplar)) for exemplar in _exemplars(kit)):
        return list(shapes)
    return [shape for shape in shapes if unmet_requirement(physical, kit_shape(kit, shape)) is None]


def _listed(name: str, kit: Kit, config: SearchConfig) -> str:
    """Return the row of replacements between the exemplars, pairs of one exemplar included."""
    up, dockings = {"y": 1, "z": 2}[kit.up] if config.upright else -1, ContactOracle(kit).dockings
    sides = [
        (exemplar, docking_graph(kit, exemplar, dockings.label_edges(exemplar.types, exemplar.poses, exemplar.edges)))
        for exemplar in _exemplars(kit)
    ]
    moves = (
        [] if kit.by_meaning else [find_region_swaps(kit, up, base, giver) for base, giver in product(sides, repeat=2)]
    )
    operations = [
        find_operations(a, b, config.dummy_edges, by_docking=not kit.by_meaning)
        for (_, a), (_, b) in combinations_with_replacement(sides, 2)
    ]
    plain = sum(found.plain for found in operations)
    cut = "" if all(found.is_whole for found in operations) else " and more"
    return (
        f"| {name} | {' + '.join(str(len(exemplar)) for exemplar, _ in sides)} | {sum(map(len, moves)):,} | "
        f"{_share(sum(map(len, moves)), sum(found.meetings for found in moves))} | {plain:,} | "
        f"{_share(plain, sum(found.meetings for found in operations))} | {sum(map(len, operations)) - plain:,}{cut} |"
    )


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else "-"


def _found(name: str, how: str, kit: Kit, finds: Finds, stable: int) -> str:
    """Return the row of a search: its hits, how many of the tested ones are `stable`, and how other tries ended."""
    counts = dict.fromkeys(REASONS, 0)
    other = 0
    for reason, count in finds.rejects.items():
        column = next((title for title, words in REASONS.items() if any(word in reason for word in words)), None)
        if column is None:
            other += count
        else:
            counts[column] += count
    fault, tested = build_test(kit, {"support": {}}), finds.kept[:MAX_SHAPES_TESTED]
    held = np.mean([fault(shape) is None for shape in tested]) if tested else 0.0
    features = np.array(finds.features).reshape(-1, len(AXES))
    mixed = np.mean(features[:, AXES.index("mixture")] >= MIN_MIXTURE) if len(features) else 0.0
    copied = np.median(features[:, AXES.index("copied_share")]) if len(features) else 0.0
    found, tried = len(finds.keys), sum(finds.rejects.values()) + len(finds.keys)
    cells = [f"{count:,}" for count in (tried, *counts.values(), other, found)]
    graphs, histograms = ({key[index] for key in finds.keys} for index in (0, 1))
    cells += [f"{held:.0%}", f"{stable / max(len(tested), 1):.0%}", f"{len(graphs):,}", f"{len(histograms):,}"]
    return f"| {name} | {how} | {' | '.join(cells)} | {mixed:.0%} | {copied:.0%} |"


if __name__ == "__main__":
    main()
