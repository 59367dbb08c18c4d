"""The four kinds of failure, each with its own consequence; nothing else is raised on purpose."""

from __future__ import annotations


class ConfigError(Exception):
    """Nothing starts; the message names the file and the key that are wrong, and what would be right."""


class Rejected(Exception):
    """One item is refused, written to the shard's rejects and counted; the run goes on.

    reason: short phrase that is the same for all such items, by which they are counted
    detail: what is special about this item
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail

    def __reduce__(self) -> tuple[type[Rejected], tuple[str, str]]:
        return (Rejected, (self.reason, self.detail))


class ShardFailed(Exception):
    """One shard failed; it is retried, then quarantined, and the run goes on."""


class Fatal(Exception):
    """Disk full or no permission: everything stops at once, and only complete files are left."""
