"""The kits among the inputs of a shard."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.stage import Task
from stages.shape.kit import Kit
from stages.shape.kit_files import load_kit

if TYPE_CHECKING:
    from stages.shape.geometry.contact_oracle import ContactOracle


def input_kits(task: Task) -> dict[str, Kit]:
    """Return the kits among the inputs of a shard, by name."""
    names = [name.partition("/")[2] for name in task.shard.inputs if name.startswith("exemplars/")]
    return {name: input_kit(task, name) for name in names}


def input_kit(task: Task, name: str) -> Kit:
    """Return one kit among the inputs of a shard; each process reads it once."""
    return _load(task.input("exemplars", f"{name}.json"), task.input("exemplars", f"{name}.tar"))


def input_oracle(task: Task, name: str) -> ContactOracle:
    """Return the contact oracle of one kit among the inputs of a shard; one for each process, so that it remembers."""
    return _oracle(task.input("exemplars", f"{name}.json"), task.input("exemplars", f"{name}.tar"))


@lru_cache(maxsize=32)
def _load(text: Path, arrays: Path) -> Kit:
    return load_kit(text, arrays)


@lru_cache(maxsize=32)
def _oracle(text: Path, arrays: Path) -> ContactOracle:
    from stages.shape.geometry.contact_oracle import ContactOracle

    return ContactOracle(_load(text, arrays))
