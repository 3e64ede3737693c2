"""The note that `recover` leaves in the log it writes, so that nobody takes that for the whole flight."""

from __future__ import annotations

from typing import TypedDict

from mcap.records import Metadata

from dslam_mav.log.topics import RECOVERED
from dslam_mav.records.words import count


class Recovered(TypedDict):
    """`lost` messages are not in the log; not `exact`: at least so many, nobody knows how many more."""

    source: str
    kept: int
    lost: int
    exact: bool


def as_metadata(recovered: Recovered) -> tuple[str, dict[str, str]]:
    """Name and content of the metadata."""
    return RECOVERED, {name: str(value).lower() if name == "exact" else str(value) for name, value in recovered.items()}


def recovered_from(metadata: Metadata) -> Recovered | None:
    """The note again; None of other metadata."""
    values = metadata.metadata
    if metadata.name != RECOVERED or values.keys() != Recovered.__annotations__.keys():
        return None
    try:
        kept, lost = int(values["kept"]), int(values["lost"])
    except ValueError:
        return None
    return Recovered(source=values["source"], kept=kept, lost=lost, exact=values["exact"] == "true")


def in_words(recovered: Recovered) -> str:
    """One clause for the reader of a log."""
    lost = lost_in_words(recovered["lost"], exact=recovered["exact"])
    return f"recovered from {recovered['source']}: {count(recovered['kept'], 'message')}, {lost}"


def lost_in_words(lost: int, *, exact: bool) -> str:
    """How many messages are lost, as far as is known."""
    if exact:
        return f"{lost or 'none'} lost"
    return f"at least {lost} lost" if lost else "how many are lost is unknown"
