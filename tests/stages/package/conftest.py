"""One toy dataset for all tests that only read it, and one cache a test for the loaders."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from tests.stages.package.toy import make_toy, toy_config


@pytest.fixture(scope="session")
def toy_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished toy dataset; not to be changed. One for all workers: who comes second has nothing to
    make."""
    own = tmp_path_factory.getbasetemp()
    out = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "toy-dataset"
    out.mkdir(exist_ok=True)
    with open(out / "lock", "wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return make_toy(out, toy_config())
