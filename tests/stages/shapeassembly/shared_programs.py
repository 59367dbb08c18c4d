"""Published programs and reference files, where they are available."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pytest

from stages.shapeassembly.sources import program_texts

SHARED = Path(__file__).resolve().parents[3].parent / "shared" / "shapeassembly"
CATEGORIES = {"chair": 3835, "table": 6536, "storage": 1551}
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the published programs")


@lru_cache(maxsize=3)
def shared_texts(category: str) -> dict[str, str]:
    """The real programs of a category by file name."""
    return dict(program_texts(SHARED / "programs.tar.xz", f"data/{category}"))
