"""One toy dataset for all tests that only read it, and one cache a test for the loaders."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.stages.package.toy import make_toy, toy_config


@pytest.fixture(scope="session")
def toy_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished toy dataset; not to be changed."""
    return make_toy(tmp_path_factory.mktemp("out"), toy_config())
