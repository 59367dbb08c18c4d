"""Limits of programs. Real ones stay far below: 3 levels, 9 cuboids an assembly, 36 copies, 80 leaves."""

from __future__ import annotations

MAX_TEXT_CHARACTERS = 1_000_000

MAX_LINES = 10_000
"""Lines of one assembly."""

MAX_DEPTH = 16
"""Nesting of assemblies."""

MAX_COPIES = 1_000
"""Copies of one translate."""

MAX_PARTS = 10_000
"""Cuboids of the executed program, expanded ones and bounding boxes included."""

MAX_NUMBER = 1e6
"""Greatest absolute number in a text."""

MIN_DECLARED_SIZE = 1e-6

MAX_BLOCK_ATTACHMENTS = 20_000
"""Attachments of one assembly, those of copies included."""

MAX_REACH = 1e9
"""Greatest coordinate and size of an executed cuboid."""
