"""What a training decides by the machine that it runs on."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from stages.training.loop import precision_of


@pytest.mark.parametrize("asked", ["float32", "bfloat16"])
def test_numbers_that_are_asked_for_by_name_are_taken(asked: str) -> None:
    assert precision_of(asked, torch.device("cpu")) == asked


def test_half_precision_is_chosen_only_where_the_processor_reckons_with_it() -> None:
    words = set(Path("/proc/cpuinfo").read_text().split())
    knows = bool(words & {"avx512_bf16", "amx_bf16", "bf16"})
    assert precision_of("auto", torch.device("cpu")) == ("bfloat16" if knows else "float32")
