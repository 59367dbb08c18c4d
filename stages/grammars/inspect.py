"""What `make inspect` says of a mesh in one piece: its grammar, and a config that makes shapes of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.places import write_file
from stages.exemplars.model import Model
from stages.exemplars.read import read_model
from stages.exemplars.settings import ReadLimits
from stages.exemplars.symmetry.parts import about_size
from stages.grammars.description import describe_grammar
from stages.grammars.extraction import Extraction, extract, mesh_of
from stages.grammars.picture import grammar_sheet
from stages.grammars.settings import GrammarConfig

__all__ = ["has_grammar", "written_grammar"]

LARGEST = 400_000
"""Cells and triangles up to which a grammar is looked for unasked: with more it takes minutes."""

CONFIG = """\
# Written by `make inspect`; ready for `make dataset CONFIG=` this file. Every key is in configs/README.md.
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


def has_grammar(model: Model, asked: str) -> bool:
    """Whether a grammar is worth a look: of a model whose parts are what symmetry makes of it, and of one part alone
    that is not too large, where nobody has said what parts are."""
    if model.segmentation == "symmetry":
        return True
    radius = float(GrammarConfig.model_fields["radius"].default)
    return asked == "auto" and len(model.parts) == 1 and about_size(mesh_of(model).corners, radius) <= LARGEST


def written_grammar(
    folder: Path, name: str, path: Path, up: str, limits: ReadLimits
) -> Iterator[tuple[str, Path | str]]:
    """Write the grammar of a model as JSON and as a picture, and a config; what each is, and where, and what there is
    in the grammar in a sentence. Nothing where nothing can be exchanged."""
    radius = float(GrammarConfig.model_fields["radius"].default)
    mesh = mesh_of(read_model(path, "components", limits))
    found = extract(mesh, name, radius, "z" if up == "z" else "y", np.random.default_rng(0))
    said = _sentence(found)
    if len(found.grammar.rules) < 2 and not found.grammar.grids:
        yield "grammar", said
        return
    text = json.dumps(describe_grammar(found), indent=1, ensure_ascii=False, allow_nan=False)
    yield "grammar", said
    yield "grammar as JSON", write_file(folder / f"{name}-grammar.json", f"{text}\n".encode())
    yield "docking sites", write_file(folder / f"{name}-grammar.png", grammar_sheet(found))
    config = CONFIG.format(
        said=said,
        name=name,
        model=json.dumps(str(path)),
        radius=radius,
        up=up,
        instances=100 if len(found.grammar.rules) > 1 else 0,
        resized=100 if found.grammar.grids else 0,
    )
    yield "grammar config", write_file(folder / f"{name}-grammar.yaml", config.encode())


def _sentence(found: Extraction) -> str:
    """What there is in a grammar."""
    grammar = found.grammar
    if not found.dockers:
        return f"none: {found.motions} motions leave no docking site"
    grids = ", ".join(" x ".join(map(str, each.counts)) for each in grammar.grids) or "none"
    classes = len({each.site for each in found.dockers})
    return (
        f"{found.motions} motions, {len(found.dockers)} dockers at {classes} classes of docking sites, "
        f"{len(grammar.rules)} rules; cells of grids: {grids}"
    )
