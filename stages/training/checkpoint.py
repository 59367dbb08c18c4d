"""Weights on disk: safetensors with a header that describes them. Pickles are never read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import ValidationError

from stages.training.model_config import ModelConfig

if TYPE_CHECKING:
    from torch import Tensor, nn

HEADER_VERSION = 1
"""A file of another version is refused."""

_KEY = "shapemill"
_PICKLE_STARTS = (b"PK\x03\x04", b"\x80")
"""First bytes of files that `torch.save` and `pickle` write."""

Config = TypeVar("Config", bound=ModelConfig)
Module = TypeVar("Module", bound="nn.Module")


class CheckpointError(ValueError):
    """A file that holds no weights, or not the expected ones."""


def checkpoint_bytes(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> bytes:
    """Return a safetensors file; equal tensors and an equal header give equal bytes."""
    from safetensors.torch import save

    text = json.dumps({**header, "version": HEADER_VERSION}, sort_keys=True, ensure_ascii=False, allow_nan=False)
    content: bytes = save({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}, {_KEY: text})
    return content


def load_checkpoint(path: Path, expected: Mapping[str, Any]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read the tensors, on the CPU, and the header of a file.

    expected: entries that the header must hold, such as `{"kit": "castle"}`.
    Raises CheckpointError, which names file and reason: a pickle, a truncated or damaged file, a file that Shapemill
    did not write, another version, a header that differs from `expected`.
    """
    from safetensors import SafetensorError, safe_open

    header = read_header(path)
    for key, value in {"version": HEADER_VERSION, **expected}.items():
        if header.get(key) != value:
            raise CheckpointError(f"{path} is of another {key}: {_difference(header.get(key), value)}")
    try:
        with safe_open(path, framework="pt", device="cpu") as stored:
            tensors: dict[str, Tensor] = {name: stored.get_tensor(name) for name in sorted(stored.keys())}
    except (SafetensorError, OSError, ValueError) as error:
        raise CheckpointError(f"{path} is cut off or damaged: {error}") from error
    return tensors, header


def load_module(
    path: Path, expected: Mapping[str, Any], config: type[Config], build: Callable[[Config, dict[str, Any]], Module]
) -> tuple[Module, dict[str, Any]]:
    """Read a model: its module, on the CPU in eval mode, and the header.

    build: makes the module from the model's config and the header.
    Raises CheckpointError as `load_checkpoint`, and for weights with other tensors than the module.
    """
    tensors, header = load_checkpoint(path, expected)
    try:
        settings = config.model_validate({"name": "trained", "kind": header["kind"], **header["settings"]})
    except ValidationError as error:
        raise CheckpointError(f"{path} has settings of another version of Shapemill: train it again") from error
    module = build(settings, header)
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return module.eval(), header


def read_header(path: Path) -> dict[str, Any]:
    """Read the header of a file of weights.

    Raises CheckpointError for a pickle, a file that cannot be read, is cut off or damaged, that Shapemill did not
    write, or whose header is no JSON mapping.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with open(path, "rb") as stream:
            start = stream.read(8)
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read: {error.strerror}") from error
    try:
        with safe_open(path, framework="np") as stored:
            metadata = stored.metadata() or {}
    except (SafetensorError, OSError, ValueError) as error:
        # Checked afterwards: safetensors begin with the length of their header, which may look like a pickle.
        if start.startswith(_PICKLE_STARTS):
            reason = "is a pickle, which may run any code when it is read: refused; only safetensors"
            raise CheckpointError(f"{path} {reason}") from error
        raise CheckpointError(f"{path} is cut off or damaged: {error}") from error
    if _KEY not in metadata:
        raise CheckpointError(f"{path} holds tensors, but Shapemill did not write it: it has no Shapemill header")
    try:
        header = json.loads(metadata[_KEY])
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{path} is damaged: its header is no JSON: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(f"{path} is damaged: its header is no mapping")
    return header


def weights_of_kind(folder: Path, kind: str) -> list[Path]:
    """Return the weights of one kind in a folder of published models, by name.

    Files with an unreadable header are among them, so that `load_checkpoint` reports why.
    """
    return [path for path in sorted(folder.glob("*/weights.safetensors")) if _kind(path) in (kind, None)]


def _kind(path: Path) -> str | None:
    try:
        kind: str | None = read_header(path).get("kind")
    except CheckpointError:
        return None
    return kind


def _difference(stored: Any, expected: Any) -> str:
    if isinstance(stored, list) and isinstance(expected, list):
        for index, (a, b) in enumerate(zip(stored, expected, strict=False)):
            if a != b:
                return f"entry {index} is {a!r}, and {b!r} is asked for"
        return f"it has {len(stored)} entries, and {len(expected)} are asked for"
    return f"{stored!r}, and {expected!r} is asked for"


def tensors_below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """Return the tensors named `<prefix>.<name>`, by `<name>`."""
    return {name[len(prefix) + 1 :]: tensor for name, tensor in tensors.items() if name.startswith(f"{prefix}.")}
