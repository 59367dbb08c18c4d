"""Work in several processes."""

from __future__ import annotations

import os

import torch

from eval.engine.parallel_map import parallel_map


def _where(item: int) -> tuple[int, int, int]:
    return item * item, torch.get_num_threads(), os.getpid()


def test_results_come_in_order_each_from_one_thread_of_another_process() -> None:
    found = list(parallel_map(_where, [3, 1, 2, 0], 2, "numbers"))
    assert [item for item, _ in found] == [3, 1, 2, 0]
    assert [square for _, (square, _, _) in found] == [9, 1, 4, 0]
    assert {threads for _, (_, threads, _) in found} == {1}
    assert os.getpid() not in {process for _, (_, _, process) in found}


def test_nothing_to_do_and_more_workers_than_work() -> None:
    assert list(parallel_map(_where, [], 8, "numbers")) == []
    assert [square for _, (square, _, _) in parallel_map(_where, [5], 8, "numbers")] == [25]
