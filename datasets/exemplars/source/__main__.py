"""Write the shipped exemplars: `python datasets/exemplars/source [--out datasets/exemplars] [--figures]`."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
REPOSITORY = FOLDER.parents[2]


def main() -> None:
    """Write every kit, or the figures, and print each file with its size."""
    sys.path.append(str(REPOSITORY))  # `python FOLDER` imports from that folder alone
    from pipeline.paths import write_file
    from shipped_kits.catalogue import write_kits
    from shipped_kits.rows_figure import rows_figure
    from shipped_kits.strictness_figure import strictness_figure

    parser = ArgumentParser(prog="python datasets/exemplars/source", description="Write the shipped exemplars.")
    parser.add_argument("--out", type=Path, default=FOLDER.parent, help="folder for <kit>/<shape>.glb")
    parser.add_argument("--figures", action="store_true", help="draw the figures of strictness and of rows instead")
    options = parser.parse_args()
    if options.figures:
        figures = {"strictness.png": strictness_figure, "rows.png": rows_figure}
        paths = [write_file(options.out / name, draw()) for name, draw in figures.items()]
    else:
        paths = list(write_kits(options.out))
    for path in paths:
        print(f"{path}  {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
