"""What the vehicle reads standing before its first leg: noise and level of the sensor, and nothing read on the move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from dslam_mav.legs import LegCollector, PlanFacts, Standing
from dslam_mav.observations import GroundSpeed, Odometry, Progress, Reading

NOISE_SD = 0.2
SPEED_M_S = 5.0
LEG_M = 40.0


@dataclass
class Told:
    """A flight: stand, approach, one leg; `level` is what is read standing, 50 everywhere else."""

    stand_s: float = 10.0
    step_ms: int = 50
    turn: Callable[[float, float], tuple[float, float]] = lambda x, y: (x, y)
    odometry: bool = True
    news_ms: int | None = None
    seed: int = 0

    def collector(self, reading: Callable[[float], float]) -> LegCollector:
        collector, rng = LegCollector(PlanFacts((2, 3), (LEG_M,))), np.random.default_rng(self.seed)
        begin_ms, leg_ms = round(1000 * self.stand_s), 1000 * round(LEG_M / SPEED_M_S)
        for t in range(0, begin_ms + 2 * leg_ms, self.step_ms):
            moved_m = SPEED_M_S * max(0, t - begin_ms) / 1000.0
            speed = SPEED_M_S if t > begin_ms else 0.0
            if self.odometry:
                collector.add(Odometry(t, *self.turn(3.0 + moved_m, 7.0), *self.turn(speed, 0.0)))
            else:
                collector.add(Odometry(t, 0.0, 0.0, 0.0, 0.0)) if t == 0 else collector.add(GroundSpeed(speed))
            value = reading(t / 1000.0) if t <= begin_ms else 50.0
            collector.add(Reading(t, value + NOISE_SD * rng.standard_normal()))
            if t == self.news_ms:
                collector.add(Progress(1, reached=True))
            if t in (begin_ms + leg_ms, begin_ms + 2 * leg_ms - self.step_ms):
                collector.add(Progress(2 + (t > begin_ms + leg_ms), reached=True))
        return collector


def stood(told: Told, reading: Callable[[float], float] = lambda _: 20.0) -> Standing:
    collector = told.collector(reading)
    legs = collector.legs(final=True)
    assert legs[-1].start_seq == 2
    standing = collector.standing(legs)
    assert standing is not None
    return standing


def test_noise_and_level_are_those_of_the_stand():
    standing = stood(Told(stand_s=20.0))
    assert standing.value.max() < 25.0, "nothing read on the way"
    assert standing.seconds == pytest.approx(20.0, abs=0.3)
    (noise_sd, freedom), (level, level_sd) = standing.noise(), standing.level()
    assert noise_sd == pytest.approx(NOISE_SD, rel=4.0 / np.sqrt(2.0 * freedom))
    assert abs(level - 20.0) < 4.0 * level_sd
    assert level_sd < 3.0 * NOISE_SD / np.sqrt(standing.value.size)


def test_a_drift_and_a_spike_are_no_noise_but_the_level_is_less_sure():
    steady = stood(Told(stand_s=20.0))
    drifting = stood(Told(stand_s=20.0), lambda t: 20.0 + 0.2 * t + (30.0 if abs(t - 8.0) < 0.01 else 0.0))
    assert drifting.noise()[0] == pytest.approx(steady.noise()[0], rel=0.1)
    assert drifting.level()[1] > 5.0 * steady.level()[1]


def test_level_errors_are_what_they_say():
    off = [(s.level()[0] - 20.0) / s.level()[1] for s in (stood(Told(seed=seed)) for seed in range(40))]
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.3


def test_news_of_the_mission_ends_a_stand():
    """A take-off that is reached: what was read until then was read elsewhere."""
    standing = stood(Told(stand_s=12.0, news_ms=4000))
    assert standing.time_ms[0] >= 4000
    assert standing.seconds == pytest.approx(8.0, abs=0.3)


@pytest.mark.parametrize("turn", [lambda x, y: (-y, x), lambda x, y: (x, -y), lambda x, y: (y, x)])
def test_turned_and_mirrored_it_is_the_same_to_the_last_bit(turn):
    plain, other = stood(Told()), stood(Told(turn=turn))
    assert plain.time_ms.tobytes() == other.time_ms.tobytes()
    assert plain.value.tobytes() == other.value.tobytes()


def test_without_a_stand_there_is_none():
    collector = Told(stand_s=0.5).collector(lambda _: 20.0)
    assert collector.standing(collector.legs(final=True)) is None
    assert LegCollector().standing(()) is None


def test_a_sensor_that_never_changes_has_no_noise():
    standing = Standing(np.arange(40), np.full(40, 3.0))
    assert standing.noise()[0] == 0.0
    assert standing.level() == (3.0, 0.0)
