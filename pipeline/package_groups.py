"""Groups of packages in pyproject.toml that set-up adds for the commands that need them."""

from __future__ import annotations

from importlib.util import find_spec

from pipeline.errors import ConfigError

_MODULES = {
    "models": ("torch", "safetensors"),
    "cluster": ("dask", "distributed"),
    "stores": ("s3fs", "huggingface_hub"),
}
"""Modules that the packages of a group bring."""


def require_group(group: str) -> None:
    """Raise ConfigError, with the remedy, where packages of a group are not installed."""
    for module in _MODULES[group]:
        if find_spec(module) is None:
            raise ConfigError(_message(module, group))


def missing_group(error: BaseException | None) -> ConfigError | None:
    """Return what to raise for a failed import of a package whose group is not installed; None for other errors."""
    if isinstance(error, ModuleNotFoundError):
        for group, modules in _MODULES.items():
            if error.name and error.name.partition(".")[0] in modules:
                return ConfigError(_message(error.name.partition(".")[0], group))
    return None


def _message(module: str, group: str) -> str:
    return f"this needs {module}, which is not installed: run `make setup-{group}`"
