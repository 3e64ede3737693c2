"""The verdicts in words: how they look on the page, what they mean, and what a pilot can do about them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from dslam_mav.records import Verdict

OWN_NAME = "flight.mcap"
"""Of every log that a flight writes, in a folder of its own."""

Tone = Literal["good", "caution", "bad"]

TONES: dict[Verdict, Tone] = {
    Verdict.IDENTIFIED: "good",
    Verdict.AMBIGUOUS: "caution",
    Verdict.MODEL_MISFIT: "caution",
    Verdict.NOT_IDENTIFIABLE: "bad",
    Verdict.NOT_CONVERGED: "bad",
    Verdict.TOO_FEW_DATA: "bad",
}

NAMES = {
    Verdict.IDENTIFIED: "Identified",
    Verdict.AMBIGUOUS: "Ambiguous",
    Verdict.NOT_IDENTIFIABLE: "Not identifiable",
    Verdict.MODEL_MISFIT: "Model misfit",
    Verdict.NOT_CONVERGED: "Not converged",
    Verdict.TOO_FEW_DATA: "Too few data",
}

MEANINGS = {
    Verdict.IDENTIFIED: (
        "One arrangement of sources and legs explains the readings, up to the noise that is left. "
        "The ± values and ellipses say how closely."
    ),
    Verdict.AMBIGUOUS: (
        "More than one arrangement explains the readings almost equally well. The most likely one is shown "
        "first; compare it with the alternatives before acting on it. Further legs in new directions tell "
        "them apart."
    ),
    Verdict.NOT_IDENTIFIABLE: (
        "Along this path the sources could move in at least one way without changing the readings beyond "
        "their noise. Any position drawn here would be a guess, so none is. Fly more legs that cross one "
        "another at wide angles, such as a star, and pass within about two √C of the sources."
    ),
    Verdict.MODEL_MISFIT: (
        "The residuals are larger or more regular than noise. Look for the legs where they are: a wrong "
        "distance along the leg, a wrong spread, wind, or one source more than assumed are the usual causes. "
        "Errors may be larger than the ± values say."
    ),
    Verdict.NOT_CONVERGED: (
        "No arrangement of sources and legs was found that explains the readings, so no position is shown. "
        "Check the assumptions below, above all the spread, the number of sources and where distances come "
        "from."
    ),
    Verdict.TOO_FEW_DATA: (
        "There are fewer legs or readings than unknowns, so no position is shown. Fly more legs, or assume "
        "fewer sources."
    ),
}


def title_of(log: Path, begun_s: float | None = None) -> str:
    """A heading for the flight in this log: when it was, as its folder says or its first packet (seconds since 1970),
    and of a file with a name of its own that too.
    """
    own = log.stem if log.name != OWN_NAME else ""
    try:
        begun = datetime.strptime(log.parent.name[:16], "%Y%m%dT%H%M%SZ")
    except ValueError:
        if begun_s is None:
            return f"Flight {own or log.absolute().parent.name}"
        begun = datetime.fromtimestamp(begun_s, UTC)
    when = f"{begun.day} {begun:%B %Y, %H:%M:%S} UTC"
    return f"Flight {own}, {when}" if own else f"Flight of {when}"
