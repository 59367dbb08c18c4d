"""The contract of a kind of models; each kind is a folder of this room."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.stage import Outcome, Task
from stages.training.model_config import ModelConfig

if TYPE_CHECKING:
    from stages.training.training_task import TrainingTask


@dataclass(frozen=True)
class Kind:
    """A kind of models: the constant KIND in `<folder of the kind>/training.py`.

    config: the kind's entry in `training.models`.
    prepare: prepare the samples of a kit or a program, as files `<shard>.<anything>`.
    new_task: build a task with fresh weights from a round's shard, the model's config and a seed. The shard's params
        name the `kit` or `program`, and `data`, the shard that `prepare` wrote.
    """

    config: type[ModelConfig]
    prepare: Callable[[Task], Outcome]
    new_task: Callable[[Task, Any, int], TrainingTask]


def kind_module(name: str) -> str:
    """Return the module that defines a kind."""
    return f"{__name__.rpartition('.')[0]}.{name}.training"


def find_kind(name: str) -> Kind:
    """Return the kind of a name, that of its folder."""
    kind: Kind = importlib.import_module(kind_module(name)).KIND
    return kind
