"""Configs: one YAML for each dataset, validated as a whole before any work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict

__all__ = ["Config", "StrictModel"]

Section = TypeVar("Section", bound="StrictModel")


class StrictModel(BaseModel):
    """Base of every config section: frozen, no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


@dataclass(frozen=True)
class Config:
    """A validated config: the dataset's own facts, and one section for each stage."""

    name: str
    version: str
    seed: int
    sections: Mapping[str, StrictModel]
    path: Path

    def section(self, model: type[Section]) -> Section:
        """The section that a stage declared with the config class `model`."""
        for section in self.sections.values():
            if isinstance(section, model):
                return section
        raise KeyError(f"no stage declares {model.__name__}")
