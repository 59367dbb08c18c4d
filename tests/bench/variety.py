"""What a search finds in a given CPU time, by each method and by both, guided by its archive or at random.

python -m tests.bench.variety [--seconds 120] [--workers 2] [--grammar multiset] [--guidance] [--sheets DIR] [CONFIG...]

CPU seconds of each worker are counted, not those of the clock, so a busy machine changes little. Workers do not
exchange what they find, as the lanes of a real search do after each round. Prints one Markdown table, and draws the
most different finds of each way where a folder is named.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from pipeline.config import load_config
from pipeline.paths import write_file
from pipeline.registry import find_stages
from stages.autoconfig.trial_search import type_counts
from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import ExemplarsConfig
from stages.inspection.sample_figure import MAX_SHAPES_SHOWN, ShownShape, ShownShapes, sample_figure
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, STRICTNESS
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from stages.variations.novelty.features import AXES, MIN_MIXTURE
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.selection.farthest_first import farthest_first
from stages.variations.settings import SearchConfig, VariationsConfig

OWN = ("default/castle", "default/temple", "default/space-base", "default/playground")
CONFIGS = (
    *OWN,
    "castle",
    "dungeon",
    "spacebase-hall",
    "ring-segments",
    "ball-track",
    "racetrack",
    "bridge",
    "temple",
)
TRIES_PER_SLICE = 2000
WARM_UP = 300
MAX_VARIANTS_KEPT = 2000
HEADER = (
    "| kit | search | tries | variants | a CPU s | graphs | histograms | at quarters | mixed | blended | E | copied "
    "| MB |\n"
    "|---|---|---:|---:|---:|---:|---:|---|---:|---:|---:|---:|---:|"
)


@dataclass
class Finds:
    """What searches have found. keys: graph and histogram of each variant; features: float32 (10,) of each; curve:
    numbers of variants after each quarter of the time; megabytes: the most memory that a process held; kept: the
    first of them, where they are shown; different: the most different of those; rejects: why other tries gave none."""

    tries: int = 0
    keys: list[tuple[int, int]] = field(default_factory=list)
    features: list[np.ndarray] = field(default_factory=list)
    curve: list[int] = field(default_factory=list)
    crossings: Counter[str] = field(default_factory=Counter)
    megabytes: float = 0.0
    different: list[Assembly] = field(default_factory=list)
    kept: list[Assembly] = field(default_factory=list)
    rejects: Counter[str] = field(default_factory=Counter)


def configured(name: str, grammar: str | None = None) -> tuple[Kit, SearchConfig]:
    """The first kit of `configs/<name>.yaml`, or the one after a stroke in its name, with another strictness if asked,
    and how it is searched."""
    name, _, chosen = name.partition("/")
    sections = {name: stage.config for name, stage in find_stages().items()}
    config = load_config(Path(f"configs/{name}.yaml"), sections)
    kits = config.section(ExemplarsConfig).kits
    kit_config = next((kit_config for kit_config in kits if kit_config.name == chosen), kits[0])
    if grammar is not None:
        kit_config = kit_config.model_copy(update={"grammar": grammar})
    kit, _ = build_kit(kit_config, [read_parts(shape.path, kit_config.parts) for shape in kit_config.shapes])
    return kit, config.section(VariationsConfig).search


def explore(kit: Kit, config: SearchConfig, seconds: float, seed: int, shown: bool = False) -> Finds:
    """One worker's search for some CPU seconds, after a warm-up that is not counted; where they are `shown`, the
    first KEPT variants are kept to choose from."""
    Search(ContactOracle(kit), config).run(np.random.default_rng(seed), WARM_UP, 10**9, "warm", lambda count: None)
    line, rng, finds = Search(ContactOracle(kit), config), np.random.default_rng(seed), Finds()
    start, variants = time.process_time(), list[Variant]()
    for quarter in range(1, 5):
        while time.process_time() - start < seconds * quarter / 4:
            found, tries = line.run(rng, TRIES_PER_SLICE, 10**9, f"w{seed}", lambda count: None)
            finds.tries += tries
            finds.keys += [(variant.graph, variant.histogram) for variant in found]
            finds.features += [variant.features for variant in found]
            variants += found[: MAX_VARIANTS_KEPT - len(variants)] if shown else []
        finds.curve.append(len(finds.keys))
    finds.crossings, finds.rejects = line.crossings, line.rejects
    finds.kept = [variant.assembly for variant in variants]
    lists = (type_counts(kit, [entry.assembly.types for entry in of]) for of in (variants, kit.exemplars))
    finds.different = [
        variants[place].assembly for place in farthest_first(*lists, min(MAX_SHAPES_SHOWN, len(variants))).tolist()
    ]
    finds.megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return finds


def _row(name: str, how: str, workers: Sequence[Finds], seconds: float) -> str:
    keys = [key for entry in workers for key in entry.keys]
    features = np.array([entry for worker in workers for entry in worker.features]).reshape(-1, len(AXES))
    graphs, histograms = len({graph for graph, _ in keys}), len({histogram for _, histogram in keys})
    quarters = [len({key[1] for entry in workers for key in entry.keys[: entry.curve[at]]}) for at in range(4)]
    mixed = np.mean(features[:, AXES.index("mixture")] >= MIN_MIXTURE) if keys else 0.0
    blended = np.mean(features[:, AXES.index("neighbourhood_mixture")] > 0) if keys else 0.0
    distance = features[:, AXES.index("distance")].mean() if keys else 0.0
    copied = np.median(features[:, AXES.index("copied_share")]) if keys else 0.0
    return (
        f"| {name} | {how} | {sum(entry.tries for entry in workers):,} | {len(keys):,} | "
        f"{len(keys) / seconds / len(workers):,.0f} | {graphs:,} | {histograms:,} | "
        f"{' '.join(f'{entry:,}' for entry in quarters)} | {mixed:.0%} | {blended:.0%} | {distance:.2f} | "
        f"{copied:.0%} | "
        f"{max(entry.megabytes for entry in workers):,.0f} |"
    )


def main() -> None:
    """Search every kit in several ways and print the table, and for kits of several exemplars why crossings fail."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.variety", description="What the search finds.")
    parser.add_argument("configs", nargs="*", help=f"names in configs/; all of {', '.join(CONFIGS)} if none is named")
    parser.add_argument("--seconds", type=float, default=120.0, help="CPU seconds of each worker")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--grammar", choices=(*STRICTNESS, *SLOT_LEVELS))
    parser.add_argument("--sheets", type=Path, metavar="DIR", help="draw the most different finds of each way there")
    parser.add_argument("--guidance", action="store_true", help="random and led by the archive, instead of methods")
    asked = parser.parse_args()
    print(HEADER, flush=True)
    notes: list[str] = []
    for name in asked.configs or CONFIGS:
        kit, config = configured(name, asked.grammar)
        random = config.novelty.model_copy(update={"guided": False})
        ways = {method: config.model_copy(update={"method": method}) for method in ("exchange", "growth", "both")}
        if asked.guidance:
            ways = {"random": config.model_copy(update={"novelty": random}), "novelty": config}
        for how, asked_for in ways.items():
            jobs = [
                delayed(explore)(kit, asked_for, asked.seconds, seed, bool(asked.sheets))
                for seed in range(asked.workers)
            ]
            workers: list[Finds] = Parallel(n_jobs=asked.workers)(jobs)
            print(_row(name, how, workers, asked.seconds), flush=True)
            if asked.sheets and workers[0].different:
                shapes = [ShownShape(kit_shape(kit, entry)) for entry in workers[0].different]
                path = asked.sheets / f"{name.replace('/', '-')}-{how}.png"
                write_file(path, sample_figure(kit, [ShownShapes("Most different finds", shapes, how)], name))
        if len(kit.exemplars) > 1:
            crossings = sum((entry.crossings for entry in workers), Counter[str]()).most_common()
            notes.append(
                f"{name}: tries across exemplars: " + ", ".join(f"{count:,} {why}" for why, count in crossings)
            )
    print("\n" + "\n".join(notes))


if __name__ == "__main__":
    main()
