"""The toy dataset that the tests of packaging make."""

from __future__ import annotations

from tests.stages.package.conftest import toy_folder

__all__ = ["toy_folder"]
