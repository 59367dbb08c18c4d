"""Compare the model readers with trimesh and, where it is installed, assimp.

python -m tests.model_readers FOLDER...
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from tests.model_readers.compare import FIELDS, compare_models


def main() -> int:
    """Print each refusal and difference, and tables of agreements; 1 if anything differs from every library."""
    parser = argparse.ArgumentParser(prog="python -m tests.model_readers", description="Compare the model readers.")
    parser.add_argument("folders", type=Path, nargs="+", help="folders with model files")
    results = []
    for result in compare_models(parser.parse_args().folders):
        results.append(result)
        if result.refusal:
            print(f"refused ({', '.join(result.peers) or 'nobody'} reads it): {result.refusal}", flush=True)
        elif result.differing:
            print(f"{result.path}: {', '.join(result.differing)} ({', '.join(result.peers)})", flush=True)
    read = [result for result in results if not result.refusal]
    explained = Counter(reason for result in read for reason in result.explained)
    explained_fields = Counter(reason.partition(":")[0] for result in read for reason in result.explained)
    differing = Counter(field for result in read for field in result.differing)
    compared = sum(bool(result.peers) for result in read)
    print(f"\n{len(results)} models: {len(read)} read, {len(results) - len(read)} refused; {compared} compared")
    print("\n| field | agree | explained | differ |\n|---|---:|---:|---:|")
    for field in FIELDS:
        agree = compared - differing[field] - explained_fields[field]
        print(f"| {field} | {agree} | {explained_fields[field]} | {differing[field]} |")
    print()
    for reason, count in sorted(explained.items()):
        print(f"{count} explained: {reason}")
    seconds = sorted(result.seconds for result in results)
    print(f"\n{sum(seconds) / len(seconds):.3f} CPU seconds a model, at most {seconds[-1]:.2f}")
    return int(bool(differing))


if __name__ == "__main__":
    sys.exit(main())
