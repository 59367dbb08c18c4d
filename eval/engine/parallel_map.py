"""Work about several models or kits, in several processes, each on one thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def parallel_map(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int, what: str
) -> Iterator[tuple[Item, Result]]:
    """Each item and what comes of it, in the order of the items, whatever the number of workers. what: the items, as a
    progress bar calls them."""
    from joblib import Parallel, delayed, parallel_config
    from tqdm import tqdm

    workers = max(1, min(workers, len(items)))
    with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1):
        results = Parallel(return_as="generator")(delayed(_on_one_thread)(work, item) for item in items)
        yield from zip(items, tqdm(results, what, len(items), unit="", disable=None, leave=False), strict=True)


def _on_one_thread(work: Callable[[Item], Result], item: Item) -> Result:
    """A token at a time is no work for two threads; and sums that are split otherwise would end in other digits."""
    import torch

    torch.set_num_threads(1)
    return work(item)
