"""Global constraints that a config may require, each a module with `CONSTRAINT` (substructures §5.3).

A folder `stages/variations/constraints` elsewhere on the PYTHONPATH adds its own.
"""

from __future__ import annotations

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
