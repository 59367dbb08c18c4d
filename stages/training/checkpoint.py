"""Weights on disk: safetensors whose header says what they are. Nothing else is read, and pickles least of all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

HEADER_VERSION = 1
"""Of what stands in the header. A file of another version is refused."""

_KEY = "shapemill"
_PICKLES = (b"PK\x03\x04", b"\x80")
"""How what `torch.save` and `pickle` write begins."""


class CheckpointError(ValueError):
    """A file that holds no weights, or not those that were asked for."""


def checkpoint_bytes(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> bytes:
    """A safetensors file: equal tensors and an equal header make equal bytes."""
    from safetensors.torch import save

    text = json.dumps({**header, "version": HEADER_VERSION}, sort_keys=True, ensure_ascii=False, allow_nan=False)
    content: bytes = save({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}, {_KEY: text})
    return content


def load_checkpoint(path: Path, expected: Mapping[str, Any]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """The tensors and the header of a file, on the CPU.

    Raises CheckpointError, which names the file and the reason: a pickle; a file that is cut off or damaged, or that
    Shapemill did not write; another version; a header that says something else than `expected`, such as
    `{"kit": "castle"}`.
    """
    from safetensors import SafetensorError, safe_open

    header = read_header(path)
    for key, wanted in {"version": HEADER_VERSION, **expected}.items():
        if header.get(key) != wanted:
            raise CheckpointError(f"{path} is of another {key}: {_difference(header.get(key), wanted)}")
    try:
        with safe_open(path, framework="pt", device="cpu") as stored:
            tensors: dict[str, Tensor] = {name: stored.get_tensor(name) for name in sorted(stored.keys())}
    except (SafetensorError, OSError, ValueError) as error:
        raise CheckpointError(f"{path} is cut off or damaged: {error}") from error
    return tensors, header


def read_header(path: Path) -> dict[str, Any]:
    """What a file of weights says of itself. Raises CheckpointError for a pickle and for a file that cannot be read, is
    cut off or damaged, that Shapemill did not write, or whose header is no JSON mapping."""
    from safetensors import SafetensorError, safe_open

    try:
        with open(path, "rb") as stream:
            beginning = stream.read(8)
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read: {error.strerror}") from error
    try:
        with safe_open(path, framework="np") as stored:
            metadata = stored.metadata() or {}
    except (SafetensorError, OSError, ValueError) as error:
        # Asked afterwards: safetensors begin with the length of their header, which may look like a pickle.
        if beginning.startswith(_PICKLES):
            told = "is a pickle, which may run any code when it is read: refused; only safetensors"
            raise CheckpointError(f"{path} {told}") from error
        raise CheckpointError(f"{path} is cut off or damaged: {error}") from error
    if _KEY not in metadata:
        raise CheckpointError(f"{path} holds tensors, but Shapemill did not write it: its header does not say what of")
    try:
        header = json.loads(metadata[_KEY])
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{path} is damaged: what its header says of itself is no JSON: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(f"{path} is damaged: what its header says of itself is no mapping")
    return header


def weights_of_kind(folder: Path, kind: str) -> list[Path]:
    """The weights of one kind in a folder of published models, by name; among them those that do not say of what kind
    they are, for `load_checkpoint` to say why they cannot be read."""
    return [path for path in sorted(folder.glob("*/weights.safetensors")) if _kind(path) in (kind, None)]


def _kind(path: Path) -> str | None:
    try:
        kind: str | None = read_header(path).get("kind")
    except CheckpointError:
        return None
    return kind


def _difference(found: Any, wanted: Any) -> str:
    if isinstance(found, list) and isinstance(wanted, list):
        for place, (one, other) in enumerate(zip(found, wanted, strict=False)):
            if one != other:
                return f"entry {place} is {one!r}, and {other!r} is asked for"
        return f"it has {len(found)} entries, and {len(wanted)} are asked for"
    return f"{found!r}, and {wanted!r} is asked for"


def tensors_below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """Those of `tensors` whose name begins with `prefix` and a dot, by the rest of their name."""
    return {name[len(prefix) + 1 :]: each for name, each in tensors.items() if name.startswith(f"{prefix}.")}
