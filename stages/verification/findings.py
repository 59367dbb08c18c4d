"""Findings of `make verify`: checks, faults and skipped samples."""

from __future__ import annotations

from dataclasses import dataclass, field

MAX_FAULTS_PRINTED = 20
"""Of each check."""


@dataclass
class Findings:
    """Result of verification.

    checked: number of things checked, by check
    faults: sentences by check
    skipped: number of samples that could not be checked, by reason
    """

    checked: dict[str, int] = field(default_factory=dict)
    faults: dict[str, list[str]] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)

    def look(self, check: str, count: int = 1) -> None:
        """Count things that `check` has checked."""
        self.checked[check] = self.checked.get(check, 0) + count

    def fault(self, check: str, where: str, what: str) -> None:
        """Add a fault."""
        self.faults.setdefault(check, []).append(f"{where}: {what}")

    def skip(self, why: str) -> None:
        """Count a sample that could not be checked."""
        self.skipped[why] = self.skipped.get(why, 0) + 1

    def add(self, other: Findings) -> None:
        """Add the findings of another part."""
        for check, count in other.checked.items():
            self.look(check, count)
        for check, faults in other.faults.items():
            self.faults.setdefault(check, []).extend(faults)
        for why, count in other.skipped.items():
            self.skipped[why] = self.skipped.get(why, 0) + count

    def lines(self) -> list[str]:
        """Return a table and the faults, for people."""
        lines = []
        for check in sorted({*self.checked, *self.faults}):
            faults = self.faults.get(check, [])
            verdict = f"{len(faults)} faults" if faults else "good"
            lines.append(f"  {check:<15}{self.checked.get(check, 0):>9,} checked   {verdict}")
        lines += [f"  not checked: {count:,} samples: {why}" for why, count in self.skipped.items()]
        for check, faults in self.faults.items():
            lines += [f"{check}: {fault}" for fault in faults[:MAX_FAULTS_PRINTED]]
            if len(faults) > MAX_FAULTS_PRINTED:
                lines.append(f"{check}: and {len(faults) - MAX_FAULTS_PRINTED} more")
        return lines
