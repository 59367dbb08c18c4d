"""Metrics as pure functions, tables that are found in `eval/tables`, and one report of them all."""

from __future__ import annotations

from pkgutil import extend_path

import stages  # noqa: F401 -- says to Numba where kernels are kept

__path__ = extend_path(__path__, __name__)
"""A folder `eval` elsewhere on the PYTHONPATH adds its tables to these."""
