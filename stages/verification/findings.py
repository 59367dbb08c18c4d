"""What `make verify` has looked at, and what it found."""

from __future__ import annotations

from dataclasses import dataclass, field

MAX_FAULTS_PRINTED = 20
"""So many faults of one check are printed."""


@dataclass
class Findings:
    """What was looked at, by check, how often; what is wrong with it, each named; what could not be looked at, and why,
    with how often."""

    checked: dict[str, int] = field(default_factory=dict)
    faults: dict[str, list[str]] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)

    def look(self, check: str, count: int = 1) -> None:
        """Note that `check` has looked at `count` more things."""
        self.checked[check] = self.checked.get(check, 0) + count

    def fault(self, check: str, where: str, what: str) -> None:
        """Note a fault of `where`."""
        self.faults.setdefault(check, []).append(f"{where}: {what}")

    def skip(self, why: str) -> None:
        """Note something that could not be looked at."""
        self.skipped[why] = self.skipped.get(why, 0) + 1

    def add(self, other: Findings) -> None:
        """Take in what was found elsewhere."""
        for check, count in other.checked.items():
            self.look(check, count)
        for check, faults in other.faults.items():
            self.faults.setdefault(check, []).extend(faults)
        for why, count in other.skipped.items():
            self.skipped[why] = self.skipped.get(why, 0) + count

    def lines(self) -> list[str]:
        """A table, and the faults, for people."""
        lines = []
        for check in sorted({*self.checked, *self.faults}):
            faults = self.faults.get(check, [])
            verdict = f"{len(faults)} faults" if faults else "good"
            lines.append(f"  {check:<15}{self.checked.get(check, 0):>9,} looked at   {verdict}")
        lines += [f"  not looked at: {count:,} samples: {why}" for why, count in self.skipped.items()]
        for check, faults in self.faults.items():
            lines += [f"{check}: {fault}" for fault in faults[:MAX_FAULTS_PRINTED]]
            if len(faults) > MAX_FAULTS_PRINTED:
                lines.append(f"{check}: and {len(faults) - MAX_FAULTS_PRINTED} more")
        return lines
