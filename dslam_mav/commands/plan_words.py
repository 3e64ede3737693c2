"""What `plan` says of a mission, in words and as JSON."""

from __future__ import annotations

import math
from argparse import Namespace
from typing import TYPE_CHECKING, Any

from dslam_mav.dslam.outlook import BLIND_SHARE, Outlook, Range
from dslam_mav.records.words import count

if TYPE_CHECKING:
    from dslam_mav.commands.plan_again import Suggestion
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.commands.plan_simulate import Simulated


def predicted(seen: Outlook, expected: Expectation) -> str:
    """One line of figures."""
    low, high = expected.prior.k_sources
    who = count(high, "source") if low == high else f"{low} to {high} sources"
    wide = "–".join(f"{s:.3g}" for s in dict.fromkeys(expected.prior.spread_m))
    what = f"Predicted for {who}, √C {wide} m, noise sd {expected.sensing.noise_sd:.2g}"
    if not math.isfinite(seen.source.median_m):
        return f"{what}: no source can be placed"
    tail = (
        f"90 % of layouts {seen.source.p90_m:.2g} m"
        if math.isfinite(seen.source.p90_m)
        else f"{100.0 * seen.unidentifiable_share:.0f} % of layouts cannot be identified"
    )
    return (
        f"{what}: sources to {seen.source.median_m:.2g} m rms ({tail}), path to {seen.path.median_m:.2g} m; "
        f"by the whole path {seen.source_aligned.median_m:.2g} and {seen.path_aligned.median_m:.2g} m"
    )


def verdict(seen: Outlook) -> str:
    """One sentence."""
    share = 100.0 * seen.unidentifiable_share
    if seen.unidentifiable_share > BLIND_SHARE:
        return f"Blind: {share:.0f} % of layouts of sources cannot be identified on this path."
    if seen.poor:
        return (
            f"Sees badly: {share:.0f} % of layouts cannot be identified, half of all no better than to "
            f"{seen.source.median_m / seen.spread_m:.2f} √C."
        )
    return "Sees well, for sources within the area; a second answer may still fit as well, which no bound shows."


def warning(why: str, instead: Suggestion | None, limited: bool) -> str:
    """Why the plan is poor, and what to fly instead; `limited`: by a fence or turns."""
    if instead is None:
        within = " within these limits" if limited else ""
        return (
            f"{why}; no star here{within} sees better, even thrice as long: know headings (--heading-sd), read with "
            "less noise or more often, or narrow the area"
        )
    star, seen = instead.star, instead.seen
    well = "sees to" if not seen.poor else "sees badly too, but to"
    return (
        f"{why}; a {star.pattern} of {star.leg_m * star.legs:.0f} m at the same place {well} "
        f"{seen.source.median_m:.2g} m: {instead.command}"
    )


def realised(flown: Simulated) -> str:
    """Figures of simulated flights."""
    return (
        f"{count(flown.flights, 'simulated mission')}: sources to {_metres(flown.source.median_m)} rms "
        f"(90 % {_metres(flown.source.p90_m)}), predicted for them {_metres(flown.predicted.median_m)} "
        f"({_metres(flown.predicted.p90_m)}); path to {_metres(flown.path.median_m)}; "
        f"a second answer fits as well in {100.0 * flown.second_share:.0f} %, none is given in "
        f"{100.0 * flown.unanswered_share:.0f} %"
    )


def _metres(value: float) -> str:
    return f"{value:.2g} m" if math.isfinite(value) else "nowhere"


def turn(degrees: float) -> str:
    """How a corner turns."""
    if abs(degrees) < 0.05:
        return ", then straight on"
    return f", then {abs(degrees):.1f}° {'left' if degrees > 0 else 'right'}"


def as_json(seen: Outlook) -> dict[str, Any]:
    """`predicted` of the contract, and more."""
    return {
        "source_error_m": range_json(seen.source),
        "path_error_m": range_json(seen.path),
        "unidentifiable_share": seen.unidentifiable_share,
        "source_error_aligned_m": range_json(seen.source_aligned),
        "path_error_aligned_m": range_json(seen.path_aligned),
    }


def simulated_json(flown: Simulated | None) -> dict[str, Any] | None:
    """`simulated`."""
    if flown is None:
        return None
    return {
        "flights": flown.flights,
        "source_error_m": range_json(flown.source),
        "path_error_m": range_json(flown.path),
        "predicted_source_error_m": range_json(flown.predicted),
        "predicted_path_error_m": range_json(flown.predicted_path),
        "nearest_answer_error_m": range_json(flown.nearest),
        "second_answer_share": flown.second_share,
        "unanswered_share": flown.unanswered_share,
    }


def prior_json(expected: Expectation, options: Namespace) -> dict[str, Any]:
    """What the figures are for."""
    return {
        "sources": list(expected.prior.k_sources),
        "spread_m": list(expected.prior.spread_m),
        "noise_sd": expected.sensing.noise_sd,
        "readings_per_m": expected.sensing.readings_per_m,
        "area_m": [float(side) for side in expected.prior.region.extent],
        "layouts": sum(len(group) for group in expected.groups),
        "seed": options.seed,
    }


def instead_json(instead: Suggestion | None) -> dict[str, Any] | None:
    """`instead`."""
    return None if instead is None else {"command": instead.command, "predicted": as_json(instead.seen)}


def range_json(values: Range) -> dict[str, float | None]:
    """NaN and infinity are null."""
    return {
        "median": values.median_m if math.isfinite(values.median_m) else None,
        "p90": values.p90_m if math.isfinite(values.p90_m) else None,
    }
