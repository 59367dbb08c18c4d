"""What `make inspect` says of a mesh in one piece: its grammar, and a config that makes shapes of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from pipeline.paths import write_file
from stages.exemplars.model import Model
from stages.exemplars.settings import ReadLimits
from stages.grammars.description import describe_grammar
from stages.grammars.distinct_shapes import METHODS, preview_shapes
from stages.grammars.export_clouds import write_clouds
from stages.grammars.extraction.extract import ExtractedGrammar, extract_grammar, model_surface
from stages.grammars.picture import grammar_sheet, shapes_sheet
from stages.grammars.read_surface import read_surface
from stages.grammars.scans.scanned_grid import ScannedCloud, required_points, suitable_radius
from stages.grammars.settings import MAX_RADIUS_SHARE, GrammarConfig
from stages.symmetry.surface.grid import estimate_grid_size

SHOWN = 12
"""So many shapes by each method are drawn to see what will come."""
CLOUDS = 4
"""About so many of them are written as clouds, if the model is one."""
FEWEST = 8
"""With fewer shapes there is no config: a split has as many shards."""
LARGEST = 400_000
"""Cells and triangles up to which a grammar is looked for unasked: with more it takes minutes."""

READY = "ready for `make dataset CONFIG=` this file"
READY_CLOUD = """of a point cloud. `python -m pipeline run grammars --config` this file makes its
# shapes, and `python -m stages.grammars.export_clouds` writes them as PLY; what comes after it looks at surfaces"""
CONFIG = """\
# Written by `make inspect`; {ready}. Every key is in configs/README.md.
# {said}.
name: {name}-grammar
seed: 1
license: unknown   # of the dataset, as an SPDX id such as CC-BY-4.0
grammars:
  models:
    - name: {name}
      model: {model}
      credit: {{license: unknown}}   # whose the model is
      radius: {radius}   # of similarity, as a share of the longest side
      up: {up}
      instances: {instances}   # by random rules
      resized: {resized}   # grids with other numbers of cells
"""


def may_have_grammar(model: Model, asked: str) -> bool:
    """Whether a grammar is worth a look: of a model whose parts are what symmetry makes of it, and of one part alone
    that is not too large, where nobody has said what parts are."""
    if model.segmentation == "symmetry":
        return True
    radius = float(GrammarConfig.model_fields["radius"].default)
    return (
        asked == "auto"
        and len(model.parts) == 1
        and estimate_grid_size(model_surface(model).corners, radius) <= LARGEST
    )


def write_grammar_report(
    folder: Path, name: str, path: Path, up: str, limits: ReadLimits
) -> Iterator[tuple[str, Path | str]]:
    """Write the grammar of a mesh or cloud as JSON and as a picture, some shapes of it, and a config; what each is, and
    where, and what there is in the grammar in a sentence. No config where few shapes differ from the model to the
    eye."""
    surface, _ = read_surface(path, limits)
    config = GrammarConfig(name=name, model=path.resolve(), up="z" if up == "z" else "y")
    if isinstance(surface, ScannedCloud):
        radius = suitable_radius(surface, config.radius)
        if radius > MAX_RADIUS_SHARE:
            raise ConfigError(
                f"{path}: too thin or too noisy: it takes a radius of {radius:.0%} of its longest side, at most "
                f"{MAX_RADIUS_SHARE:.0%} make sense; scan more densely, or take the noise out"
            )
        if radius > config.radius:
            yield "radius", _coarse(surface, radius, config.radius)
        config = config.model_copy(update={"radius": radius})
    found = extract_grammar(surface, name, config.radius, "z" if up == "z" else "y", np.random.default_rng(0))
    said = _sentence(found)
    yield "grammar", said
    if len(found.grammar.productions) < 2 and not found.grammar.grids:
        return
    text = json.dumps(describe_grammar(found), indent=1, ensure_ascii=False, allow_nan=False)
    yield "grammar as JSON", write_file(folder / f"{name}-grammar.json", f"{text}\n".encode())
    yield "docking sites", write_file(folder / f"{name}-grammar.png", grammar_sheet(found))
    drawn = preview_shapes(found.grammar, config, SHOWN)
    counts = {method: len(each) for method, each in drawn.items()}
    yield "shapes", _prospect(counts)
    if not any(counts.values()):
        return
    shapes = [each for listed in drawn.values() for each in listed]
    yield "some shapes", write_file(folder / f"{name}-grammar-shapes.png", shapes_sheet(found.grammar, shapes))
    if found.grammar.splats:
        yield from write_clouds(folder, f"{name}-grammar", found.grammar, shapes[:: max(1, len(shapes) // CLOUDS)])
    if len(shapes) < FEWEST:
        return
    asked = {method: 100 if count == SHOWN else count for method, count in counts.items()}
    written = CONFIG.format(
        ready=READY_CLOUD if found.grammar.splats else READY,
        said=said,
        name=config.name,
        model=json.dumps(str(path)),
        radius=config.radius,
        up=up,
        instances=asked[METHODS[0]],
        resized=asked[METHODS[1]],
    )
    yield "grammar config", write_file(folder / f"{name}-grammar.yaml", written.encode())


def _prospect(counts: dict[str, int]) -> str:
    """How many shapes a short search found that differ to the eye, and what may help where they are few."""
    found = ", ".join(f"{count}{' or more' * (count == SHOWN)} by {method}" for method, count in counts.items())
    if any(count == SHOWN for count in counts.values()):
        return found
    many = "few" if sum(counts.values()) >= FEWEST else "too few"
    return (
        f"{found}, {many} for a dataset: all else looks like the model, for what may dock at a site is nearly what is "
        "there. A smaller grammars.models[].radius finds more sites; else take the model by its parts"
    )


def _coarse(cloud: ScannedCloud, radius: float, usual: float) -> str:
    """What a scan is too thin or too noisy for."""
    points = required_points(cloud, usual)
    more = "less noise" if points is None else f"about {points:,} points, {len(cloud.points):,} are there,"
    return f"{radius:.1%} of the longest side: what is finer is not seen; with {more} it could be {usual:.1%}"


def _sentence(found: ExtractedGrammar) -> str:
    """What there is in a grammar."""
    grammar = found.grammar
    if not found.docked_pieces:
        return f"none: {found.transforms} motions leave no docking site"
    grids = ", ".join(" x ".join(map(str, each.counts)) for each in grammar.grids) or "none"
    classes = len({each.site for each in found.docked_pieces})
    return (
        f"{found.transforms} motions, {len(found.docked_pieces)} dockers at {classes} classes of docking sites, "
        f"{len(grammar.productions)} rules; cells of grids: {grids}"
    )
