"""Words that go with numbers."""

from __future__ import annotations


def count(number: int, noun: str) -> str:
    """ "1 leg", "7 legs", "458,752 readings"."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def agree(number: int, one: str, many: str) -> str:
    """The verb that goes with so many."""
    return one if number == 1 else many
