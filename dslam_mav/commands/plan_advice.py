"""Why a plan sees badly, and what to fly instead within the same limits."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from typing import TYPE_CHECKING

from dslam_mav.commands.plan_making import Planned
from dslam_mav.records.arrays import Array

if TYPE_CHECKING:
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.dslam.outlook import Outlook
    from missions.nearest import Instead


def advice(
    options: Namespace, planned: Planned, path: Array, seen: Outlook, expected: Expectation
) -> tuple[str, Instead | None]:
    """Half a sentence, and a star that keeps fence, margin and turns, if one sees better."""
    from dslam_mav.dslam.outlook import reason
    from missions.fence import Fence
    from missions.nearest import ANYWHERE, Limits, nearest_that_sees

    middle = expected.prior.region.middle

    def star(limits: Limits) -> Instead | None:
        centre_m = (float(middle[0]), float(middle[1]))
        return nearest_that_sees(path, seen, expected.groups, expected.sensing, centre_m, limits)

    low, high = options.turn or (0.0, 180.0)
    limits = Limits(planned.kept or Fence(), options.margin or 0.0, (math.radians(low), math.radians(high)))
    instead = star(limits)
    if options.turn and (instead is None or instead.seen.poor):
        free = star(replace(limits, turn_rad=ANYWHERE.turn_rad))
        if free is not None and not free.seen.poor:
            return (
                f"its turns are held to {low:g}° to {high:g}° by --turn, and a {free.pattern} without that limit sees "
                f"to {free.seen.source.median_m:.2g} m",
                instead,
            )
    return reason(path, expected.groups, expected.sensing), instead
