"""Frames collected into legs, as the tests of the collector do it."""

from __future__ import annotations

from flown import Flown

from dslam_mav.legs.collector import LegCollector
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Frame


def collect(frames: list[Frame], **options) -> LegCollector:
    collector = LegCollector(options.pop("plan", None), distance=options.pop("distance", None))
    for frame in frames:
        observation = decode(frame, 1, **options)
        if observation is not None:
            collector.add(observation)
    return collector


def distance_error_m(flown: Flown, collector: LegCollector) -> float:
    errors = []
    for j, leg in enumerate(collector.legs(final=True)):
        for t, s in zip(leg.time_ms, leg.distance_m, strict=True):
            truly_on, truth_m = flown.distance_m[int(t) % 2**32]
            # the reading at a corner may count to either leg
            errors.append(abs(s - truth_m if truly_on == j else s - truth_m + flown.lengths_m[truly_on]))
    assert errors
    return max(errors)


def of_type(frames: list[Frame], *kinds: str) -> list[Frame]:
    return [f for f in frames if f.message.get_type() in kinds]


def without(frames: list[Frame], *kinds: str) -> list[Frame]:
    return [f for f in frames if f.message.get_type() not in kinds]
