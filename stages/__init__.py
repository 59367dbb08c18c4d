"""The way of the data: what makes shapes (exemplars, variations, programs, shapeassembly), then what is made of it."""

from __future__ import annotations

import os
import sys
from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
"""A folder `stages` elsewhere on the PYTHONPATH adds its stages to these."""

os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = (
    "pipeline.kernel_cache.KernelLocator,"
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator,ZipCacheLocator"
)
"""Compiled kernels are kept by `pipeline/kernel_cache.py`. The others are Numba's own, for kernels of libraries."""
if "numba" in sys.modules:
    sys.modules["numba"].config.reload_config()
