"""Stands where the inspection of a mesh stands; says what it was asked."""

from __future__ import annotations


def main(arguments: list[str]) -> int:
    """Print the arguments."""
    print("inspect", *arguments)
    return 0
