from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from sim_bridge.sampling import Sampler, Samples, Sampling

SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 7.03), (0.0, 7.03)]
SEQS = (2, 3, 4, 5)


def fly(
    sampler: Sampler,
    corners: list[tuple[float, float]] = SQUARE,
    *,
    speed_m_s: float = 2.0,
    step_ms: int = 20,
    hold_ms: int = 0,
    start_ms: int = 5000,
    approach: bool = True,
) -> list[list[Samples]]:
    """Straight legs with a position every `step_ms` and at every corner, then the corner's number: by leg."""
    taken: list[list[Samples]] = []
    time_ms = start_ms
    if approach:
        sampler.position(time_ms - 1000, (-5.0, 0.0, 0.0))
        taken.append([sampler.position(time_ms - 500, (-2.0, 0.0, 1.0))])
    taken.append([sampler.position(time_ms, (*corners[0], 1.0))])
    sampler.reached(SEQS[0])
    for seq, (a, b) in zip(SEQS[1:], itertools.pairwise(corners), strict=False):
        leg: list[Samples] = []
        flown_ms = math.dist(a, b) / speed_m_s * 1e3
        marks = [*range(step_ms, math.ceil(flown_ms), step_ms), round(flown_ms)]
        for t in marks:
            u = 1.0 if t == marks[-1] else t / flown_ms
            place = (a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), 1.0)
            leg.append(sampler.position(time_ms + t, place))
        time_ms += marks[-1]
        for t in range(step_ms, hold_ms, step_ms):
            leg.append(sampler.position(time_ms + t, (*b, 1.0)))
        time_ms += hold_ms
        sampler.reached(seq)
        taken.append(leg)
    taken.append([sampler.position(time_ms + 5 * step_ms, (50.0, 50.0, 1.0))])
    return taken


def joined(samples: list[list[Samples]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    flat = [s for leg in samples for s in leg]
    return tuple(np.concatenate([getattr(s, n) for s in flat]) for n in ("time_boot_ms", "time_s", "place_m"))  # type: ignore[return-value]


@settings(max_examples=25, deadline=None)
@given(spacing_m=st.floats(0.02, 3.0), speed_m_s=st.floats(1.0, 10.0), step_ms=st.integers(10, 300))
def test_uniform_in_distance_from_every_corner(spacing_m: float, speed_m_s: float, step_ms: int) -> None:
    sampler = Sampler(Sampling(spacing_m=spacing_m), SEQS)
    times, time_s, places = joined(fly(sampler, speed_m_s=speed_m_s, step_ms=step_ms))
    assert sampler.finished
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(time_s, (times - 5000) / 1e3)
    tolerance_m = 2.0 * speed_m_s * 1e-3  # a millisecond of flight, and the corners' own rounding
    begin_ms, read = 5000, 0
    for a, b in itertools.pairwise(SQUARE):
        length = math.dist(a, b)
        end_ms = begin_ms + round(length / speed_m_s * 1e3)
        leg = places[(begin_ms <= times) & (times < end_ms)]
        np.testing.assert_allclose(leg[0], [*a, 1.0])
        s = np.linalg.norm(leg[:, :2] - a, axis=1)
        np.testing.assert_allclose(s, spacing_m * np.arange(len(s)), atol=tolerance_m)
        assert math.ceil((length - tolerance_m) / spacing_m) <= len(s) <= math.ceil((length + tolerance_m) / spacing_m)
        begin_ms, read = end_ms, read + len(s)
    assert read == len(times)
    assert sampler.skipped == 0


def test_each_leg_starts_at_its_corner_and_stops_before_the_next() -> None:
    sampler = Sampler(Sampling(spacing_m=0.5), SEQS)
    taken = fly(sampler)
    counts = [sum(len(s.time_boot_ms) for s in leg) for leg in taken]
    assert counts == [0, 0, 20, 15, 20, 0]  # 10/0.5, 7.03/0.5 rounded up, 10/0.5; nothing before or after
    first_of_second = next(s for s in taken[3] if len(s.time_boot_ms))
    np.testing.assert_allclose(first_of_second.place_m[0], [10.0, 0.0, 1.0])
    assert first_of_second.time_boot_ms[0] == 10000


def test_uniform_in_time_runs_on_over_corners_and_holds() -> None:
    sampler = Sampler(Sampling(interval_s=0.033), SEQS)
    times, _, _ = joined(fly(sampler, hold_ms=1000))
    n = np.arange(len(times))
    np.testing.assert_array_equal(times, 5000 + np.floor(33.0 * n + 0.5).astype(int))
    flight_ms = 5000 + 3515 + 5000 + 3 * 1000
    assert times[-1] < 5000 + flight_ms
    assert len(times) >= (flight_ms - 1000) / 33.0


def test_a_hold_at_the_corner_adds_no_readings_in_distance() -> None:
    sampler = Sampler(Sampling(spacing_m=0.3), SEQS)
    counts = [sum(len(s.time_boot_ms) for s in leg) for leg in fly(sampler, hold_ms=1000)]
    assert counts == [0, 0, 34, 24, 34, 0]


def test_always_reads_before_and_after_the_mission_too() -> None:
    sampler = Sampler(Sampling(interval_s=0.1), SEQS, always=True)
    times, time_s, _ = joined(fly(sampler))
    assert times[0] == 4000
    assert time_s[0] == 0.0
    assert times[-1] > 5000 + 13515
    assert not sampler.finished


def test_places_are_where_the_vehicle_is_at_the_whole_millisecond() -> None:
    sampler = Sampler(Sampling(spacing_m=0.1234), SEQS[:2])
    times, _, places = joined(fly(sampler, [(0.0, 0.0), (10.0, 0.0)], speed_m_s=3.0, step_ms=40))
    np.testing.assert_allclose(places[:, 0], 3.0 * (times - 5000) / 1e3, atol=2e-3)
    exact = times < times[-1] - 40  # the corner lies at 3333.3 ms
    np.testing.assert_allclose(places[exact, 0], 3.0 * (times[exact] - 5000) / 1e3, atol=1e-9)


def test_hovering_back_after_an_overshoot_is_not_read_twice() -> None:
    sampler = Sampler(Sampling(spacing_m=1.0), SEQS)
    sampler.position(0, (0, 0, 0))
    sampler.reached(2)
    track = [0.0, 2.5, 5.2, 4.0, 3.0, 5.0, 6.1]
    taken = [sampler.position(1000 * (i + 1), (x, 0, 0)) for i, x in enumerate(track)]
    _, _, places = joined([taken])
    np.testing.assert_allclose(places[:, 0], [0, 1, 2, 3, 4, 5, 6], atol=0.01)


def test_repeated_and_foreign_progress_changes_nothing() -> None:
    plain, noisy = Sampler(Sampling(spacing_m=0.5), SEQS), Sampler(Sampling(spacing_m=0.5), SEQS)
    position = noisy.position

    def with_noise(time_boot_ms: int, place_m: tuple[float, ...]) -> Samples:
        noisy.reached(1)
        if noisy.started:
            noisy.reached(2)  # PX4 repeats it once a second
        noisy.reached(9)
        return position(time_boot_ms, place_m)

    noisy.position = with_noise  # type: ignore[method-assign, assignment]
    for a, b in zip(joined(fly(plain)), joined(fly(noisy)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_faster_vehicle_than_milliseconds_allow_is_refused_or_counted() -> None:
    Sampling(spacing_m=0.005).check(5.0)
    with pytest.raises(BadInputError) as caught:
        Sampling(spacing_m=0.004).check(5.0)
    assert str(caught.value) == ("spacing_m 0.004: expected 0.005 or more at 5 m/s, times on the wire are whole ms")
    with pytest.raises(BadInputError, match=r"interval_s 0\.0004: expected 0\.001 or more"):
        Sampling(interval_s=0.0004)
    sampler = Sampler(Sampling(spacing_m=0.004), SEQS)
    times, _, _ = joined(fly(sampler, speed_m_s=5.0))
    assert (np.diff(times) > 0).all()
    assert sampler.skipped > 1000


@pytest.mark.parametrize("wrong", [{}, {"spacing_m": 1.0, "interval_s": 1.0}, {"spacing_m": -1.0}])
def test_sampling_is_by_distance_or_by_time(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="spacing_m: expected"):
        Sampling(**wrong)


def test_a_mission_without_legs_is_refused() -> None:
    with pytest.raises(BadInputError, match="mission: expected at least 2 waypoints, got 1"):
        Sampler(Sampling(spacing_m=1.0), (4,))


def test_a_mission_that_grew_or_shrank_in_flight_is_read_to_its_end() -> None:
    for by, last in ((2, 7), (-1, 4)):
        sampler = Sampler(Sampling(spacing_m=1.0), SEQS)
        for seq in range(2, last + 1):
            sampler.position(1000 * seq, (10.0 * (seq % 2), 0.0, 1.0))
            assert not sampler.finished
            if seq == 3:
                sampler.end_at(SEQS[-1] + by, 4)  # on the way to item 4
            sampler.reached(seq)
        assert sampler.finished


def test_before_the_first_vertex_a_mission_may_still_be_any() -> None:
    sampler = Sampler(Sampling(spacing_m=1.0), SEQS)
    sampler.end_at(SEQS[-1] + 1, 0)
    for seq in SEQS:
        sampler.position(1000 * seq, (10.0 * (seq % 2), 0.0, 1.0))
        sampler.reached(seq)
    assert sampler.finished


def test_it_knows_where_the_vehicle_was_at_the_vertices_that_were_told() -> None:
    sampler = Sampler(Sampling(spacing_m=1.0), SEQS)
    sampler.position(1000, (0.1, 0.0, 1.0))
    sampler.reached(SEQS[0])
    sampler.position(3000, (11.4, 0.3, 1.0))  # overshot
    sampler.reached(SEQS[1])
    sampler.position(4000, (10.0, 4.0, 1.0))
    sampler.passed(SEQS[2], SEQS[3])  # lost: by the item flown to it is known too late
    assert {seq: place.tolist() for seq, place in sampler.reached_m.items()} == {
        SEQS[0]: [0.1, 0.0, 1.0], SEQS[1]: [11.4, 0.3, 1.0]
    }  # fmt: skip
