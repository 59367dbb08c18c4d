"""Whether models of a config learn from the samples of its dataset: `python -m stages.training --config CONFIG`.

The exit code says it, for `make train`: 0, they do; 1, they make their shapes themselves, and no sample need be made
for them; 2, the config is not valid.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pipeline.config import load_config
from pipeline.errors import ConfigError
from pipeline.registry import find_stages
from stages.training.stage import uses_samples


def main(arguments: list[str]) -> int:
    """The exit code; see the module."""
    parser = argparse.ArgumentParser(prog="stages.training", description=__doc__.splitlines()[0])
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--only", default="", help="a model's name, or <name>-<kit or program>")
    asked = parser.parse_args(arguments)
    try:
        loaded = load_config(asked.config, {name: stage.config for name, stage in find_stages().items()})
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    return 0 if uses_samples(loaded, asked.only) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
