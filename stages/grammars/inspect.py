"""The part of `make inspect` on a mesh in one piece: its grammar, and a config that makes shapes of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from pipeline.paths import write_file
from stages.exemplars.model import Model
from stages.grammars.description import describe_grammar
from stages.grammars.distinct_shapes import RANDOM_RULES, RESIZED_GRID, preview_shapes
from stages.grammars.export_clouds import write_clouds
from stages.grammars.extraction.extract import ExtractedGrammar, extract_grammar, model_surface
from stages.grammars.picture import grammar_sheet, shapes_sheet
from stages.grammars.read_surface import read_surface
from stages.grammars.scans.scanned_grid import ScannedCloud, required_points, suitable_radius
from stages.grammars.settings import MAX_RADIUS_SHARE, GrammarConfig
from stages.model_files.limits import ReadLimits
from stages.symmetry.surface.grid import estimate_grid_size

PREVIEW_SHAPES = 12
"""Shapes by each method that are sampled for the preview."""
PREVIEW_CLOUDS = 4
"""About the number of them that are written as clouds, if the model is a cloud."""
MIN_CONFIG_SHAPES = 8
"""With fewer shapes no config is written: a split has as many shards by default."""
MAX_DEFAULT_SIZE = 400_000
"""Cells and triangles up to which a grammar is searched by default: larger models take minutes."""
CONFIG_SHAPES = 100
"""Shapes by each method in the written config, where the preview found no end of them."""

READY = "ready for `make dataset CONFIG=<this file>`"
READY_CLOUD = """of a point cloud. `shapemill run grammars --config <this file>` makes its shapes,
# and `shapemill grammar-clouds` writes them as PLY; later stages need surfaces"""
CONFIG = """\
# Written by `make inspect`; {ready}. Every key is in configs/README.md.
# {summary}.
name: {name}-grammar
seed: 1
license: unknown   # of the dataset, as an SPDX id such as CC-BY-4.0
grammars:
  models:
    - name: {name}
      model: {model}
      credit: {{license: unknown}}   # of the model
      radius: {radius}   # of similarity, as a share of the longest side
      up: {up}
      random_shapes: {random_shapes}   # by random productions
      resized_grids: {resized_grids}   # grids with other numbers of cells
"""


def may_have_grammar(model: Model, segmentation: str) -> bool:
    """Return whether a grammar is worth a search.

    segmentation: the requested one

    True for a model that symmetry cuts into parts. With segmentation `auto` also for a single part that is not too
    large.
    """
    if model.segmentation == "symmetry":
        return True
    radius = float(GrammarConfig.model_fields["radius"].default)
    return (
        segmentation == "auto"
        and len(model.parts) == 1
        and estimate_grid_size(model_surface(model).corners, radius) <= MAX_DEFAULT_SIZE
    )


def write_grammar_report(
    folder: Path, name: str, path: Path, up: str, limits: ReadLimits
) -> Iterator[tuple[str, Path | str]]:
    """Write the grammar of a mesh or cloud as JSON and as a picture, some of its shapes, and a config.

    Yields names of files and facts with their paths or sentences. No config is written where few shapes differ visibly
    from the model.
    """
    surface, _, warnings = read_surface(path, limits)
    config = GrammarConfig(name=name, model=path.resolve(), up="z" if up == "z" else "y")
    if isinstance(surface, ScannedCloud):
        if warnings:
            yield "columns", "; ".join(warnings)
        radius = suitable_radius(surface, config.radius)
        if radius > MAX_RADIUS_SHARE:
            raise ConfigError(
                f"{path}: too thin or too noisy: it takes a radius of {radius:.0%} of its longest side, at most "
                f"{MAX_RADIUS_SHARE:.0%} make sense; scan more densely, or take the noise out"
            )
        if radius > config.radius:
            yield "radius", _coarse_radius(surface, radius, config.radius)
        config = config.model_copy(update={"radius": radius})
    extracted = extract_grammar(surface, name, config.radius, "z" if up == "z" else "y", np.random.default_rng(0))
    grammar = extracted.grammar
    summary = _summary(extracted)
    yield "grammar", summary
    if len(grammar.productions) < 2 and not grammar.grids:
        return
    text = json.dumps(describe_grammar(extracted), indent=1, ensure_ascii=False, allow_nan=False)
    yield "grammar as JSON", write_file(folder / f"{name}-grammar.json", f"{text}\n".encode())
    yield "docking sites", write_file(folder / f"{name}-grammar.png", grammar_sheet(extracted))
    preview = preview_shapes(grammar, config, PREVIEW_SHAPES)
    counts = {method: len(texts) for method, texts in preview.items()}
    yield "shapes", _yield_estimate(counts)
    if not any(counts.values()):
        return
    shapes = [text for texts in preview.values() for text in texts]
    yield "some shapes", write_file(folder / f"{name}-grammar-shapes.png", shapes_sheet(grammar, shapes))
    if grammar.splats:
        step = max(1, len(shapes) // PREVIEW_CLOUDS)
        yield from write_clouds(folder, f"{name}-grammar", grammar, shapes[::step])
    if len(shapes) < MIN_CONFIG_SHAPES:
        return
    requested = {method: CONFIG_SHAPES if count == PREVIEW_SHAPES else count for method, count in counts.items()}
    written = CONFIG.format(
        ready=READY_CLOUD if grammar.splats else READY,
        summary=summary,
        name=config.name,
        model=json.dumps(str(path), ensure_ascii=False),
        radius=config.radius,
        up=up,
        random_shapes=requested[RANDOM_RULES],
        resized_grids=requested[RESIZED_GRID],
    )
    yield "grammar config", write_file(folder / f"{name}-grammar.yaml", written.encode())


def _yield_estimate(counts: dict[str, int]) -> str:
    """Return how many visibly different shapes a short search found, and what helps if they are few."""
    numbers = ", ".join(f"{count}{' or more' * (count == PREVIEW_SHAPES)} by {name}" for name, count in counts.items())
    if any(count == PREVIEW_SHAPES for count in counts.values()):
        return numbers
    amount = "few" if sum(counts.values()) >= MIN_CONFIG_SHAPES else "too few"
    return (
        f"{numbers}, {amount} for a dataset: all others look like the model, because what may dock at a site is nearly "
        "what is there. A smaller grammars.models[].radius finds more sites; or take the model by its parts"
    )


def _coarse_radius(cloud: ScannedCloud, radius: float, default: float) -> str:
    """Return what a scan is too thin or too noisy for."""
    points = required_points(cloud, default)
    more = f"about {points:,} points instead of {len(cloud.points):,}" if points else "less noise"
    return f"{radius:.1%} of the longest side: finer detail is not seen; with {more} it could be {default:.1%}"


def _summary(extracted: ExtractedGrammar) -> str:
    """Return what a grammar contains, in one sentence."""
    grammar = extracted.grammar
    if not extracted.docked_pieces:
        return f"none: {extracted.transforms} symmetries have no docking site"
    grids = ", ".join(" x ".join(map(str, grid.counts)) for grid in grammar.grids) or "none"
    return (
        f"{extracted.transforms} symmetries, {len(extracted.docked_pieces)} docked pieces at {extracted.site_classes} "
        f"classes of docking sites, {len(grammar.productions)} productions; cells of grids: {grids}"
    )
