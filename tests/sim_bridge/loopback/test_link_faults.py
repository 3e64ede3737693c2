"""Bad links between real sockets: a transfer ends complete and verified, or with a clear error."""

from __future__ import annotations

import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import pytest
from fakes import flying, mission

from dslam_mav.errors import BadInputError, LinkError, MissionError
from dslam_mav.mav.frames import Encoder, Parser, messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.transfer import download, upload
from dslam_mav.mav.readings import to_message
from dslam_mav.observations import Reading
from sim_bridge.loopback.link_faults import HELD_S, Air, LinkFaults, of_another_system, parse_link_faults

M = messages()
EACH = ("duplicate=0.4", "reorder=0.2", "corrupt=0.1", "stranger=0.4", "silence=2")
TOGETHER = "loss=0.1,duplicate=0.1,reorder=0.1,silence=2,corrupt=0.01,stranger=0.1"


def packet(k: int) -> bytes:
    return Encoder(1, 158).pack(to_message(Reading(k, float(k))))


def carried(faults: LinkFaults, seed: int, n: int = 1000) -> list[bytes]:
    air = Air(faults, seed)
    out = [piece for k in range(n) for piece in air.carry(("peer", "in"), packet(k), 0.01 * k)]
    return out + [data for _, data in air.due(0.01 * n + HELD_S)]


def test_shares_are_as_asked_for_and_repeat_with_the_seed() -> None:
    sent = [packet(k) for k in range(1000)]
    assert carried(LinkFaults(), 0) == sent
    assert 600 < len(carried(LinkFaults(loss=0.3), 1)) < 800
    assert 1250 < len(carried(LinkFaults(duplicate=0.3), 1)) < 1350
    mixed = carried(LinkFaults(reorder=0.2), 1)
    assert mixed != sent
    assert sorted(mixed) == sorted(sent)
    assert max(abs(sent.index(raw) - k) for k, raw in enumerate(mixed)) <= 10
    assert 50 < sum(raw not in set(sent) for raw in carried(LinkFaults(corrupt=0.1), 1)) < 150
    everything = parse_link_faults(TOGETHER)
    assert carried(everything, 1) == carried(everything, 1) != carried(everything, 2)


def test_a_silence_is_as_long_as_asked_for() -> None:
    air = Air(LinkFaults(silence=2.0), 3)
    heard = [k / 100 for k in range(6000) if air.carry(("peer", "in"), packet(k), k / 100)]
    gaps = [b - a for a, b in pairwise(heard) if b - a > 0.015]
    assert gaps == pytest.approx([2.0] * len(gaps), abs=0.05)
    assert len(gaps) >= 4


def test_a_stranger_says_the_same_as_another_system() -> None:
    (frame,) = Parser().feed(of_another_system(packet(7)), 0)
    assert frame.message.get_srcSystem() == 2
    assert frame.message.time_boot_ms == 7


def test_the_clock_on_the_wire_wraps_or_starts_again() -> None:
    wraps, resets = LinkFaults(wrap=2.0), LinkFaults(reset=2.0)
    assert [wraps.time_boot_ms(t) for t in (0, 1999, 2000, 2500)] == [2**32 - 2000, 2**32 - 1, 0, 500]
    assert [resets.time_boot_ms(t) for t in (0, 1999, 2000, 2500)] == [0, 1999, 0, 500]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("loss=2", "loss '2': expected a share from 0 to 1"),
        ("loss", "loss '': expected a share"),
        ("fog=0.1", "'fog': expected some of loss, duplicate"),
        ("loss=0.1,loss=0.2", "'loss': twice"),
        ("silence=-1", "silence '-1': expected seconds"),
        ("corrupt=nan", "corrupt 'nan': expected a share"),
    ],
)
def test_a_spec_that_cannot_be_used_is_one_line(text: str, words: str) -> None:
    with pytest.raises(BadInputError, match=words):
        parse_link_faults(text)


def transfer(spec: str, seed: int) -> str:
    """An upload and a download: "whole", or what was wrong with the link in words."""
    plan = mission([(0.0, 5.0 * k) for k in range(3)])
    with flying(seed=seed, link_faults=parse_link_faults(spec)) as (url,):
        with Link(url, system=255, component=190) as link:
            try:
                system = wait_for_vehicle(link, 15.0)
                assert first_difference(plan.items, upload(link, system, plan).items) is None
                assert first_difference(plan.items, download(link, system).items) is None
            except (LinkError, MissionError) as problem:
                return str(problem)
    return "whole"


def test_a_transfer_over_bad_links_is_whole_or_its_failure_told() -> None:
    jobs = [(spec, seed) for spec in (*EACH, TOGETHER, TOGETHER) for seed in range(2)]
    with ThreadPoolExecutor(len(jobs)) as pool:
        ends = Counter(pool.map(lambda job: transfer(*job), jobs))
    assert ends["whole"] >= len(jobs) - 2, ends
    assert not any("\n" in end for end in ends)


def test_a_second_station_that_uploads_meanwhile_is_refused_or_waits_its_turn() -> None:
    ours, theirs = mission(), mission([(0.0, 9.0 * k) for k in range(5)])
    with flying(link_faults=parse_link_faults("duplicate=0.2,reorder=0.1")) as (url,):
        with Link(url, system=255, component=190) as first, Link(url, system=254, component=190) as second:
            ends: list[object] = []

            def run(link: Link, plan: object) -> None:
                try:
                    ends.append(upload(link, wait_for_vehicle(link, 10.0), plan))  # type: ignore[arg-type]
                except MissionError as problem:
                    ends.append(str(problem))

            threads = [threading.Thread(target=run, args=job) for job in ((first, ours), (second, theirs))]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(60.0)
            held = download(first, 1).items
            assert any(first_difference(plan.items, held) is None for plan in (ours, theirs))
            assert len(ends) == 2
            assert all(not isinstance(end, str) or "refused" in end or "another mission" in end for end in ends)
