"""Make trained models come with Shapemill: `python -m stages.training.recovery.ship OUT/chairs-models/clouds-chair-0`.

For maintainers: what is put below `datasets/exemplars/models/` is committed, so that `make recover` works at once from
a fresh clone.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pipeline.paths import write_file
from stages.recovery.recover import PRETRAINED_FOLDER
from stages.training.checkpoint import CheckpointError, checkpoint_bytes, load_checkpoint
from stages.training.recovery.trained import RECOVERY_KIND, load_recovery, quantized_to_bytes

MAX_SHIPPED_BYTES = 4_000_000
"""Bytes of a model that comes with a clone."""
MOST_OF_BYTES = 2
"""So many tensors may become bytes, which are coarser than halves."""


def slim_bytes(path: Path) -> bytes:
    """The file of weights `path` with numbers of half precision, which answers nearly the same; where that is too
    large, the largest of its tensors, one after the other, as bytes.

    Raises CheckpointError for weights that are not of a recovery model that can be used now, or too large still.
    """
    load_recovery(path)
    tensors, header = load_checkpoint(path, {"kind": RECOVERY_KIND})
    slim = {name: each.half() if each.is_floating_point() else each for name, each in tensors.items()}
    content = checkpoint_bytes(slim, header)
    for name in sorted(slim, key=lambda each: -slim[each].numel())[:MOST_OF_BYTES]:
        if len(content) > MAX_SHIPPED_BYTES:
            slim |= quantized_to_bytes(name, tensors[name])
            content = checkpoint_bytes(slim, header)
    if len(content) > MAX_SHIPPED_BYTES:
        raise CheckpointError(
            f"{path} takes {len(content):,} bytes at least, more than {MAX_SHIPPED_BYTES:,}: train a smaller one"
        )
    return content


def main(arguments: list[str]) -> int:
    """Put models where they are committed. Returns the exit code: 0, or 2 where one cannot be used."""
    parser = argparse.ArgumentParser(prog="stages.training.recovery.ship", description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL", help="the folder of a published model")
    asked = parser.parse_args(arguments)
    try:
        for folder in asked.models:
            weights = slim_bytes(folder / "weights.safetensors")
            card = (folder / "README.md").read_bytes()
            for name, content in (("weights.safetensors", weights), ("README.md", card)):
                print(write_file(PRETRAINED_FOLDER / folder.name.rpartition("-")[0] / name, content))
    except (CheckpointError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
