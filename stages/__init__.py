"""The way of the data: what makes shapes (exemplars, variations, programs, shapeassembly), then what is made of it."""

from __future__ import annotations

import os
from hashlib import sha256
from pathlib import Path
from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
"""A folder `stages` elsewhere on the PYTHONPATH adds its stages to these."""


def _compiled_folder() -> Path:
    """Where numba keeps what it has compiled: a folder for each state of the compiled sources.

    Numba compiles anew what stands in a file that changed, but not what calls it from another file, which would go on
    with the old code.
    """
    here = Path(__file__).parent
    sources = (path.read_bytes() for path in sorted(here.rglob("*.py")))
    state = sha256(b"".join(source for source in sources if b"numba" in source))
    return here / "__pycache__" / f"compiled-{state.hexdigest()[:12]}"


os.environ.setdefault("NUMBA_CACHE_DIR", str(_compiled_folder()))
