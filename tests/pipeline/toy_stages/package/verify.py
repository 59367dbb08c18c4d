"""Stands where the check of a finished dataset stands; says what it was asked."""

from __future__ import annotations


def main(arguments: list[str]) -> int:
    """Print the arguments; fail when they hold `--spoiled`."""
    print("verify", *arguments)
    return int("--spoiled" in arguments)
