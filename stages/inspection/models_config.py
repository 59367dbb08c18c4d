"""A config with given models in place of its kits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import yaml

from pipeline.errors import ConfigError
from pipeline.yaml_loader import read_yaml
from stages.inspection.config_text import dataset_name
from stages.model_files.folder import model_files
from stages.model_files.scene_file import READERS


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


def config_with_models(config: Path, paths: Sequence[Path]) -> tuple[str, bytes]:
    """Return the name and the YAML of a config with one kit of all models that paths name, in place of its kits.

    The name of the dataset is that of the config and of the first path. The first kit's `appearance` stays. Raises
    ConfigError as `models_of` does, and for a file that is no YAML.
    """
    models = models_of(paths)
    values, _ = read_yaml(config)
    kit = dataset_name([paths[0]])
    name = f"{values.get('name', config.stem)}-{kit}"
    exemplars = values.get("exemplars") or {}
    replaced = (exemplars.get("kits") or [{}])[0]
    look = {key: value for key, value in replaced.items() if key == "appearance"}
    kits = [{"name": kit, "shapes": [str(path) for path in models], **look}]
    values = {**values, "name": name, "exemplars": {**exemplars, "kits": kits}}
    text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=100)
    note = f"# Written from {config} for the models of MESH, and again by each `make dataset` of both."
    return name, f"{note}\n{text}".encode()
