"""What all tests share: properties are tried on the same examples in every run, and none is timed."""

from __future__ import annotations

import os

# As in workers: with several threads on a busy machine LAPACK is a hundred times slower. Before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import HealthCheck, settings

# A busy machine must not fail a test, and a failure must come back when the tests are run again.
settings.register_profile("shapemill", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shapemill")
