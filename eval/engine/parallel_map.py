"""A function over several models or kits, in several processes with one thread each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def parallel_map(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int, unit: str
) -> Iterator[tuple[Item, Result]]:
    """Yield each item with its result, in the order of the items. `unit`: what a progress bar calls the items."""
    from joblib import Parallel, delayed, parallel_config
    from tqdm import tqdm

    workers = max(1, min(workers, len(items)))
    with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1):
        results = Parallel(return_as="generator")(delayed(_on_one_thread)(function, item) for item in items)
        yield from zip(items, tqdm(results, unit, len(items), unit="", disable=None, leave=False), strict=True)


def _on_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    """Call with one torch thread: results do not depend on the machine, and small networks run no slower."""
    import torch

    torch.set_num_threads(1)
    return function(item)
