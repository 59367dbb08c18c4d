"""Make trained models come with Shapemill: `python -m stages.training.ship OUT/chairs-models/clouds-chair-0`.

For maintainers: models below `datasets/exemplars/models/` are committed, so that they work in a fresh clone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.paths import write_file
from stages.training.checkpoint import CheckpointError, checkpoint_bytes, load_checkpoint
from stages.training.load import load_model
from stages.training.recovery.trained import PRETRAINED_FOLDER, RECOVERY_KIND, quantized_to_bytes

MAX_SHIPPED_BYTES = 4_000_000
MAX_BYTE_TENSORS = 2
"""Bytes are coarser than half precision; only a recovery model is read back from them."""


def slim_bytes(path: Path) -> bytes:
    """Make the weights `path` smaller: half precision, and the largest tensors as bytes where that is too large.

    The model answers nearly the same. Raises CheckpointError for unusable weights and for those still too large.
    """
    load_model(path)
    tensors, header = load_checkpoint(path, {})
    slim = {name: tensor.half() if tensor.is_floating_point() else tensor for name, tensor in tensors.items()}
    content = checkpoint_bytes(slim, header)
    largest = sorted(slim, key=lambda name: -slim[name].numel())[:MAX_BYTE_TENSORS]
    for name in largest if header["kind"] == RECOVERY_KIND else ():
        if len(content) > MAX_SHIPPED_BYTES:
            slim |= quantized_to_bytes(name, tensors[name])
            content = checkpoint_bytes(slim, header)
    if len(content) > MAX_SHIPPED_BYTES:
        raise CheckpointError(
            f"{path} takes at least {len(content):,} bytes, more than {MAX_SHIPPED_BYTES:,}: train a smaller model"
        )
    return content


def ship(models: Annotated[list[Path], typer.Argument(help="folders of published models")]) -> None:
    """Put models where they are committed."""
    for folder in models:
        weights = slim_bytes(folder / "weights.safetensors")
        card = (folder / "README.md").read_bytes()
        for name, content in (("weights.safetensors", weights), ("README.md", card)):
            print(write_file(PRETRAINED_FOLDER / folder.name.rpartition("-")[0] / name, content))


if __name__ == "__main__":
    typer.run(ship)
