"""One module a table: each declares `TABLE = Evaluation(...)`, is called what the table is called, and is found here.

Modules are imported whenever tables are listed: what takes long to import is imported inside functions.
"""

from __future__ import annotations

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
"""A folder `eval/tables` elsewhere on the PYTHONPATH adds its tables to these."""
