"""What Shapemill sees in model files, as JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from stages.exemplars.build import Observation
from stages.exemplars.diagnostics import connected_pieces, hub_parts, mirror_twins
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from stages.shape.kit_files import kit_json

MOST_ROWS = 40
"""So many part types are listed for people."""
MOST_PIECES = 8
"""So are the sizes of so many pieces."""


def describe_observation(seen: Observation, models: Sequence[Model], config: KitConfig) -> dict[str, Any]:
    """What was found, as JSON.

    For one model `parts` (name and type, in the order of the file), `contacts` (those that count, as pairs i < j of
    indices into `parts`, sorted), `contact_kinds` (every contact, with its kind), `pieces`, `hubs` and `segmentation`
    stand at the top; for several, in one object a model under `models`. Beside them stands what the models share:
    `types`, `mirror_twins`, `neighbourhoods`, `dockings`, `tolerance`, `repairs`, `warnings`.
    """
    kit = seen.kit
    names = kit.type_names()
    counts = np.bincount(np.concatenate([each.assembly.types for each in kit.exemplars]), minlength=len(names))
    described = kit_json(kit)
    shared = {
        "types": [
            {"name": each.name, "count": int(count), "triangles": len(each.faces), "symmetries": len(each.symmetries)}
            for each, count in zip(kit.types, counts, strict=True)
        ],
        "mirror_twins": [[names[i], names[j]] for i, j in mirror_twins(kit.types, config.congruence_tolerance)],
        "neighbourhoods": described["neighbourhoods"],
        "dockings": described["dockings"],
        "tolerance": kit.contact_tolerance,
        "repairs": dict(seen.repairs),
        "warnings": [*seen.refusals, *seen.warnings],
    }
    each_model = [_model(seen, index, model) for index, model in enumerate(models)]
    return {**each_model[0], **shared} if len(models) == 1 else {"models": each_model, **shared}


def _model(seen: Observation, index: int, model: Model) -> dict[str, Any]:
    exemplar = seen.kit.exemplars[index]
    assembly, names = exemplar.assembly, exemplar.part_names
    piece = connected_pieces(assembly)
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly)).tolist()
    return {
        "model": str(model.path),
        "segmentation": {"parts": model.segmentation, "why": model.why},
        "parts": [
            {"name": name, "type": seen.kit.types[each].name} for name, each in zip(names, assembly.types, strict=True)
        ],
        "contacts": assembly.edges.tolist(),
        "contact_kinds": [
            [i, j, kind] for (i, j), kind in zip(seen.contacts[index].tolist(), seen.kinds[index], strict=True)
        ],
        "pieces": [np.flatnonzero(piece == number).tolist() for number in range(int(piece.max()) + 1)],
        "hubs": [{"part": part, "name": names[part], "contacts": degrees[part]} for part in hub_parts(assembly)],
    }


def observation_lines(found: dict[str, Any], config: KitConfig) -> Iterator[str]:
    """What `describe_observation` found, for people. `config` leaves nothing open."""
    made = config.resolved()
    models = found.get("models", [found])
    for model in models:
        yield model["model"]
        for title, line in _model_lines(model, config):
            yield f"  {title:<10} {line}"
        yield ""
    types = found["types"]
    rules = sum(len(each) for each in found["neighbourhoods"].values())
    twins = {name: other for pair in found["mirror_twins"] for name, other in (pair, pair[::-1])}
    parts = [[part["type"] for part in model["parts"]] for model in models]
    header = ["type", *(f"in {number + 1}" for number in range(len(models))), "triangles", "symmetries", ""]
    if len(models) == 1:
        header[1] = "parts"
    rows = [
        [
            each["name"],
            *(str(names.count(each["name"])) for names in parts),
            str(each["triangles"]),
            str(each["symmetries"]),
            f"mirror image of {twins[each['name']]}" if each["name"] in twins else "",
        ]
        for each in sorted(types, key=lambda each: -each["count"])
    ]
    yield from _table([header, *rows[:MOST_ROWS]])
    if len(rows) > MOST_ROWS:
        yield f"and {len(rows) - MOST_ROWS} more types, of {sum(each['count'] for each in types)} parts in all"
    yield ""
    yield f"tolerance  {found['tolerance']:.4g} units, {made.tolerance:g} of the median part's diagonal"
    repaired = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in found["repairs"].items())
    yield f"repairs    {repaired or 'none needed'}"
    yield f"grammar    {rules} neighbourhoods, {len(found['dockings'])} dockings of {len(types)} part types"
    if twins:
        yield "mirrored   a part and its mirror image are one type with `mirror_images_match: true`"
    for number, warning in enumerate(found["warnings"]):
        yield f"{'' if number else 'warnings':<10} - {warning}"


def _model_lines(model: dict[str, Any], config: KitConfig) -> Iterator[tuple[str, str]]:
    """What is particular to one model, as title and line."""
    kinds = [kind for _, _, kind in model["contact_kinds"]]
    sizes = [len(each) for each in model["pieces"]]
    degrees = np.bincount(np.array(model["contacts"], dtype=int).ravel(), minlength=len(model["parts"]))
    yield "parts", f"{len(model['parts'])} by {model['segmentation']['parts']} ({model['segmentation']['why']})"
    words = {"face": "over a face", "line": "along a line", "point": "in a point"}
    found = ", ".join(f"{kinds.count(kind)} {word}" for kind, word in words.items() if kind in kinds)
    uncounted = len(kinds) - len(model["contacts"])
    aside = f"; {uncounted} of them do not count, only kinds {', '.join(config.resolved().kinds)}" if uncounted else ""
    yield "contacts", f"{len(kinds)}" + (f": {found}" if found else "") + aside
    listed = ", ".join(map(str, sizes[:MOST_PIECES])) + (" ..." if len(sizes) > MOST_PIECES else "")
    yield "connected", "yes" if len(sizes) == 1 else f"no, {len(sizes)} pieces of {listed} parts"
    if len(degrees) > 1:
        yield "degree", f"a part touches {degrees.min()} to {degrees.max()} others, {degrees.mean():.1f} on average"


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines with the first and the last column to the left and the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for first, *middle, last in rows:
        cells = [first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(middle, widths[1:], strict=False))]
        yield "  ".join([*cells, last]).rstrip()
