"""The four ways in which work fails. Each has its own consequence, and nothing else is raised on purpose."""

from __future__ import annotations


class ConfigError(Exception):
    """Nothing starts: names the file and the key that are wrong, and what would be right."""


class Rejected(Exception):
    """One item is refused; it is written to the shard's rejects and counted, and the run goes on.

    `reason` is a short phrase that stays the same from item to item (it is what gets counted);
    `detail` says what was special about this one.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail

    def __reduce__(self) -> tuple[type[Rejected], tuple[str, str]]:
        return (Rejected, (self.reason, self.detail))


class ShardFailed(Exception):
    """One shard could not be made; it is tried again, then quarantined, and the rest goes on."""


class Fatal(Exception):
    """Disk full, no permission: everything stops at once and only whole files are left."""
