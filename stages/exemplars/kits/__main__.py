"""Writes the shipped exemplars: `python -m stages.exemplars.kits [--out datasets/exemplars]`."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from stages.exemplars.kits.catalogue import write_kits


def main() -> None:
    """Writes every kit and says what was written."""
    parser = ArgumentParser(prog="python -m stages.exemplars.kits", description="Write the shipped exemplars.")
    parser.add_argument("--out", type=Path, default=Path("datasets/exemplars"), help="folder for <kit>/<shape>.glb")
    for path in write_kits(parser.parse_args().out):
        print(f"{path}  {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
