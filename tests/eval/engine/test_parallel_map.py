"""Parallel map over processes."""

from __future__ import annotations

import os

import torch

from eval.engine.parallel_map import parallel_map


def _square(item: int) -> tuple[int, int, int]:
    return item * item, torch.get_num_threads(), os.getpid()


def test_results_are_ordered_and_from_single_threaded_processes() -> None:
    results = list(parallel_map(_square, [3, 1, 2, 0], 2, "numbers"))
    assert [item for item, _ in results] == [3, 1, 2, 0]
    assert [square for _, (square, _, _) in results] == [9, 1, 4, 0]
    assert {threads for _, (_, threads, _) in results} == {1}
    assert os.getpid() not in {process for _, (_, _, process) in results}


def test_empty_work_and_more_workers_than_items() -> None:
    assert list(parallel_map(_square, [], 8, "numbers")) == []
    assert [square for _, (square, _, _) in parallel_map(_square, [5], 8, "numbers")] == [25]
