"""Write the shipped exemplars: `python datasets/exemplars/source [--out datasets/exemplars]`."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
REPOSITORY = FOLDER.parents[2]


def main() -> None:
    """Write every kit and print each file with its size."""
    sys.path.append(str(REPOSITORY))  # `python FOLDER` imports from that folder alone
    from shipped_kits.catalogue import write_kits

    parser = ArgumentParser(prog="python datasets/exemplars/source", description="Write the shipped exemplars.")
    parser.add_argument("--out", type=Path, default=FOLDER.parent, help="folder for <kit>/<shape>.glb")
    for path in write_kits(parser.parse_args().out):
        print(f"{path}  {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
