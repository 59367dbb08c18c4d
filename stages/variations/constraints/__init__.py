"""Global constraints that a config may ask of every variant, each a module with `CONSTRAINT`, found here by its name
(substructures §5.3). A folder `stages/variations/constraints` elsewhere on the PYTHONPATH adds its own to these."""

from __future__ import annotations

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
