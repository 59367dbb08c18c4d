"""Statistics of reading hostile model files: results by kind, and the cost of the worst.

python -m tests.hostile [--count 2000] [--seed 0]
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.hostile.corpus import Outcome, outcomes

ENDS = ("read", "refused", "stopped", "escaped")


def main() -> int:
    """Print tables by mutation and by format, the worst, and every escape; 1 if anything escaped."""
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description="Read hostile model files.")
    parser.add_argument("--count", type=int, default=2000, help="number of files")
    parser.add_argument("--seed", type=int, default=0, help="seed of the mutations")
    arguments = parser.parse_args()
    results: list[Outcome] = []
    with tempfile.TemporaryDirectory() as folder:
        for outcome in outcomes(Path(folder), arguments.count, arguments.seed):
            results.append(outcome)
            if outcome.end in ("stopped", "escaped"):
                print(f"{outcome.number} {outcome.mutation}: {outcome.end}: {outcome.message}", flush=True)
    for key in ("mutation", "suffix"):
        print(f"\n| {key} | {' | '.join(ENDS)} |\n|---|{'---:|' * len(ENDS)}")
        for kind in sorted({getattr(result, key) for result in results}):
            counts = Counter(result.end for result in results if getattr(result, key) == kind)
            print(f"| {kind} | {' | '.join(str(counts[end]) for end in ENDS)} |")
    worst = max(results, key=lambda result: result.cpu)
    memory = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
    counts = Counter(result.end for result in results)
    print(f"\n{len(results)} files: {', '.join(f'{counts[end]} {end}' for end in ENDS)}")
    print(
        f"worst: {worst.cpu:.2f} CPU seconds (file {worst.number}, {worst.suffix}, {worst.mutation}), {memory:.0f} MB"
    )
    return int(counts["escaped"] > 0)


if __name__ == "__main__":
    sys.exit(main())
