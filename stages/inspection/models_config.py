"""A config with given models in place of its kits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

from pipeline.display import counting
from pipeline.errors import ConfigError
from pipeline.yaml_loader import read_yaml
from stages.exemplars.diagnostics import single_part_refusal
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.read import read_parts
from stages.exemplars.settings import KitConfig
from stages.inspection.config_text import dataset_name
from stages.model_files.folder import model_files
from stages.model_files.limits import ReadLimits
from stages.model_files.scene_file import READERS
from stages.shape.geometry.components import connected_components


def models_of(paths: Sequence[Path]) -> list[Path]:
    """Return the models that paths name, those of folders included.

    Raises ConfigError for a path that does not exist and for a folder without models.
    """
    models = []
    for path in paths:
        found = model_files(path) if path.is_dir() else [path]
        if not path.exists():
            raise ConfigError(f"there is no file or folder {path}; name models, or a folder of them, with MESH")
        if not found:
            raise ConfigError(f"{path} holds no models; name a folder with files in {', '.join(READERS)}")
        models += found
    return models


def config_with_models(config: Path, paths: Sequence[Path]) -> tuple[str, bytes, list[str]]:
    """Return a config with the models that paths name in place of its kits: its name, its YAML, and warnings.

    Models that share part types are one kit; others are kits of their own. A model that cannot be read or has one part
    is left out, with a warning. The name of the dataset is that of the config and of the first path. The first kit's
    `appearance` stays. Raises ConfigError as `models_of` does, for a file that is no YAML, and where no model is left.
    """
    models = models_of(paths)
    values, _ = read_yaml(config)
    first = dataset_name([paths[0]])
    name = f"{values.get('name', config.stem)}-{first}"
    exemplars = values.get("exemplars") or {}
    read, warnings = _read_models(models, ReadLimits.model_validate(exemplars.get("limits") or {}))
    groups = _sharing_types(read)
    names = [first] if len(groups) == 1 else _distinct([dataset_name(group) for group in groups])
    replaced = (exemplars.get("kits") or [{}])[0]
    look = {key: value for key, value in replaced.items() if key == "appearance"}
    kits = [
        {"name": kit, "shapes": [str(path) for path in group], **look} for kit, group in zip(names, groups, strict=True)
    ]
    values = {**values, "name": name, "exemplars": {**exemplars, "kits": kits}}
    text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=100)
    note = f"# Written from {config} for the models of MESH, and again by each `make dataset` of both."
    return name, f"{note}\n{text}".encode(), warnings


def _read_models(paths: Sequence[Path], limits: ReadLimits) -> tuple[list[Model], list[str]]:
    """Return the models of two parts or more, and why others are left out. Raises ConfigError where none is left."""
    models, warnings = [], []
    with counting("with-models", len(paths), "models read") as show:
        for number, path in enumerate(paths, 1):
            try:
                model = read_parts(path, limits=limits)
                if len(model.parts) < 2:
                    raise ConfigError(single_part_refusal(model))
                models.append(model)
            except ConfigError as error:
                warnings.append(f"left out: {error}")
            show(number)
    if not models:
        raise ConfigError("\n".join(warnings))
    return models, warnings


def _sharing_types(models: Sequence[Model]) -> list[list[Path]]:
    """Group models that share part types, directly or by way of others, in their order."""
    paths = [model.path for model in models]
    identified = identify_parts(models, KitConfig.model_validate({"name": "models", "shapes": tuple(paths)}))
    users: dict[int, list[int]] = {}
    for index, assembly in enumerate(identified.assemblies):
        for part_type in np.unique(assembly.types).tolist():
            users.setdefault(part_type, []).append(index)
    pairs = [pair for sharing in users.values() for pair in pairwise(sharing)]
    group_of = connected_components(len(models), np.array(pairs, dtype=np.int64).reshape(-1, 2))
    return [[paths[index] for index in np.flatnonzero(group_of == group)] for group in range(group_of.max() + 1)]


def _distinct(names: Sequence[str]) -> list[str]:
    """Number names that occur again: chair, chair-2."""
    found: list[str] = []
    for name in names:
        number, distinct = 2, name
        while distinct in found:
            number, distinct = number + 1, f"{name}-{number}"
        found.append(distinct)
    return found
