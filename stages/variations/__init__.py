"""Shape graphs to many valid new assemblies by exchange of subgraphs with matching boundaries (strings §4)."""

from __future__ import annotations

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
"""A folder `stages/variations` elsewhere on the PYTHONPATH adds its constraints to these."""
