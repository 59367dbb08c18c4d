"""Make one shard of a published dataset again, from its manifest, and compare the bytes."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError

from pipeline.config import Config, load_config
from pipeline.display import ticking
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths, file_digest, read_json
from pipeline.run import run_stages
from pipeline.stage import Stage
from stages.exemplars.diagnostics import listed_names
from stages.package.layout import MANIFEST
from stages.package.manifest import config_sections
from stages.package.versions import code_version, library_versions
from stages.shape.collection.discovery import producers
from stages.shapeassembly.extraction.readers.source import HierarchyKind, HierarchySource
from stages.shapeassembly.sources import source_digest


class _Shard(BaseModel):
    path: str
    split: str
    sha256: str

    @property
    def short_name(self) -> str:
        """Split and number: `train-000007`."""
        return f"{self.split}-{Path(self.path).stem.rpartition('-')[2]}"


class _Origin(BaseModel):
    file: str
    sha256: str


class _Software(BaseModel):
    shapemill: str
    libraries: dict[str, str]


class _Manifest(BaseModel):
    """What is read of a manifest."""

    name: str
    version: str
    seed: int
    config: dict[str, Any]
    shards: list[_Shard]
    origins: list[_Origin]
    software: _Software

    @property
    def facts(self) -> dict[str, Any]:
        """What a config has besides the sections."""
        return {"name": self.name, "version": self.version, "seed": self.seed}


def reproduce_shard(
    manifest_file: Path, shard_name: str, stages: Mapping[str, Stage], folders: Sequence[Path], workers: int
) -> Iterator[str]:
    """Make a shard of a published dataset again in a temporary folder, and yield what differs, in sentences.

    manifest_file: `manifest.json` of the dataset, or its folder
    shard_name: split and number, such as `train-000007`, or the name of its file
    folders: searched for the models that the dataset was made from; they are known by their sha256

    Only the shard and what it reads are made: the exemplars, the search for variants, and this shard of each stage.
    Raises ConfigError for a manifest that cannot be read, an unknown shard, and models that are not found.
    """
    manifest = _manifest(manifest_file)
    published = _shard(manifest, shard_name, manifest_file)
    with tempfile.TemporaryDirectory(prefix="shapemill-") as temporary:
        with ticking("reproduce", "looking for the models by their sha256"):
            models = _models(manifest, folders)
        config = _config(manifest, models, stages, Path(temporary))
        paths = DatasetPaths(Path(temporary), config.name)
        target = f"{config.name}-{published.short_name}"
        before, after = _split_at_collection(config, stages)
        results = run_stages(before, stages, config, paths, workers)
        failed = [message for result in results.values() for message in result.failed.values()]
        if not failed:
            results = run_stages(after, stages, config, paths, workers, target=target)
            failed = [message for result in results.values() for message in result.failed.values()]
        made = paths.stage("package").root / f"{target}.tar"
        if failed or not made.is_file():
            yield failed[0] if failed else f"the search makes no shard {target} now"
        elif file_digest(made) != published.sha256:
            yield f"{published.path} has other bytes now"
            yield from _versions(manifest.software)


def _manifest(path: Path) -> _Manifest:
    file = path / MANIFEST if path.is_dir() else path
    try:
        return _Manifest.model_validate(read_json(file))
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"]))
        raise ConfigError(
            f"{file}: is no manifest of a dataset ({where or 'all'}); name the dataset's folder"
        ) from None


def _shard(manifest: _Manifest, name: str, path: Path) -> _Shard:
    for shard in manifest.shards:
        if Path(name).name in (shard.short_name, Path(shard.path).name):
            return shard
    listed = listed_names([shard.short_name for shard in manifest.shards])
    raise ConfigError(f"{path}: has no shard {name}; it has {listed}")


def _config(manifest: _Manifest, models: Mapping[str, str], stages: Mapping[str, Stage], folder: Path) -> Config:
    """Return the config of a manifest, with the paths of its models. Raises ConfigError, naming a file in `folder`."""
    file = folder / "config.yaml"  # the name may be anything until it is checked
    models_of = {name: stage.config for name, stage in stages.items()}
    defaults = config_sections(
        Config(**manifest.facts, sections={name: own() for name, own in models_of.items()}, path=file)
    )
    # A section that is left out may hold what it may not state, such as views without cameras.
    stated = {name: section for name, section in manifest.config.items() if section != defaults.get(name)}
    file.write_text(yaml.safe_dump(manifest.facts | _located(stated, models)), encoding="utf-8")
    config = load_config(file, models_of)
    for stage in stages.values():
        stage.check(config)
    return config


def _split_at_collection(config: Config, stages: Mapping[str, Stage]) -> tuple[list[str], list[str]]:
    """Return the stages before the one whose shards hold the samples, which are needed whole, and the others."""
    used = [name for name, declared in producers().items() if declared.is_requested(config)]
    collection = max(used, key=lambda name: producers()[name].joins)
    names = [name for name, stage in stages.items() if not stage.publishes_incomplete]
    place = names.index(collection)
    return names[:place], names[place:]


def _models(manifest: _Manifest, folders: Sequence[Path]) -> dict[str, str]:
    """Return the path of each input by the name that the manifest's config has for it: its folder's and its own.

    An input is a model, an archive or weights, or a folder or a file of programs or hierarchies.
    """
    found: dict[str, str] = {}
    digests: dict[str, str] = {}
    for origin in manifest.origins:
        name, digest = origin.file, origin.sha256
        if digests.setdefault(name, digest) != digest:
            raise ConfigError(f"two models of the dataset are called {name}: its manifest does not tell which is where")
        for folder in folders:
            near = sorted(folder.rglob(Path(name).name))
            match = next((path for path in near if digest in _digests(path)), None)
            if match is not None:
                found[name] = str(match)
                break
        if name not in found:
            places = ", ".join(map(str, folders))
            raise ConfigError(f"{name}, sha256 {digest}, is not below {places}; name its folder with --models")
    return found


def _digests(path: Path) -> Iterator[str]:
    """Yield what a manifest may state of a file or folder: of its bytes, its programs, or its hierarchies."""
    yield file_digest(path) if path.is_file() else source_digest(path)
    for kind in get_args(HierarchyKind):
        if kind != "grass" or path.is_file():
            yield HierarchySource(path, kind, "auto").digest(0, sys.maxsize)


def _located(value: Any, models: Mapping[str, str]) -> Any:
    """Return a config's values with the paths of models in place of their names."""
    if isinstance(value, Mapping):
        return {key: _located(item, models) for key, item in value.items()}
    if isinstance(value, list):
        return [_located(item, models) for item in value]
    return models.get(value, value) if isinstance(value, str) else value


def _versions(software: _Software) -> Iterator[str]:
    """Yield what else is here than what the dataset was made with."""
    if software.shapemill != code_version():
        yield f"it was made with Shapemill {software.shapemill}, and this is {code_version()}"
    here = library_versions()
    for name, version in software.libraries.items():
        if here.get(name) != version:
            yield f"it was made with {name} {version}, and this is {here.get(name, 'not installed')}"
