"""How large a program may be. The real ones stay far below: 3 levels, 9 cuboids an assembly, 36 copies, 80 leaves."""

from __future__ import annotations

MAX_TEXT_CHARACTERS = 1_000_000
"""Characters of a program's text."""

MAX_LINES = 10_000
"""Lines of one assembly."""

MAX_DEPTH = 16
"""Assemblies within each other."""

MAX_COPIES = 1_000
"""Copies that one translate makes."""

MAX_PARTS = 10_000
"""Cuboids of the executed program, those that are expanded and the bounding boxes included."""

MAX_NUMBER = 1e6
"""Largest number in a program."""

MIN_DECLARED_SIZE = 1e-6
"""Smallest size of a declared cuboid."""

MAX_BLOCK_ATTACHMENTS = 20_000
"""Attachments of one assembly, those of copies included."""

MAX_REACH = 1e9
"""Largest coordinate and size of an executed cuboid."""
