"""A mission changed in flight: read back, or the old one stays."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from fakes import ScriptedVehicle, flying, mission

from dslam_mav.errors import MissionError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission import change as changing
from dslam_mav.mav.mission import protocol, talk
from dslam_mav.mav.mission.change import change
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.messages import from_message, to_message
from dslam_mav.mav.mission.protocol import ACCEPTED, DENIED, Ack, Count, Item, Request, RequestList
from dslam_mav.mav.mission.transfer import download, start, upload
from dslam_mav.mission import Mission, MissionItem, leg_plan
from missions.continued import continued

M = messages()
SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]
OLD = mission(SQUARE)
NEW = continued(OLD, leg_plan(OLD).sequence[1], [2.0, 1.0, -2.5], [30.0, 20.0, 25.0])
FLYING = leg_plan(OLD).sequence[1]


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "TIMEOUT_S", 0.15)
    monkeypatch.setattr(protocol, "RETRIES", 1)
    monkeypatch.setattr(talk, "SILENCE_S", 2.0)
    monkeypatch.setattr(changing, "PLACE_WAIT_S", 0.3)


@dataclass
class Holder:
    """An ArduPilot's manners: what comes is stored at once; or a PX4's: with the last item, `whole`. `spoil` breaks the
    first uploads, in one way or another.
    """

    spoil: Callable[[Holder, int, MissionItem], MissionItem | int | None]
    spoilt: int = 1  # uploads
    whole: bool = False
    items: list[MissionItem] = field(default_factory=lambda: list(OLD.items))
    coming: list[MissionItem] = field(default_factory=list)
    count: int = 0
    uploads: int = 0
    current: int = FLYING
    told: list[int] = field(default_factory=list)
    begin_flags: list[int] = field(default_factory=list)

    def answer(self, message: Any) -> list[Any]:
        if message.get_type() == "MISSION_SET_CURRENT":
            self.told.append(message.seq)
            self.current = message.seq
        if message.get_type() == "MISSION_ITEM_INT":
            self.begin_flags.append(message.current)
        record = from_message(message)
        where = M.MAVLink_mission_current_message(self.current)
        replies = [to_message(r, 255, 190) for r in self._step(record)] if record is not None else []
        return [*replies, where]

    def _step(self, record: Any) -> list[Any]:  # noqa: PLR0911  one return a message
        match record:
            case Count(count):
                self.count, self.uploads, self.coming = count, self.uploads + 1, list(self.items)
                return [Request(0)]
            case Item(seq, item):
                kept = self.spoil(self, seq, item) if self.uploads <= self.spoilt else item
                if kept is None:
                    return []
                if isinstance(kept, int):
                    return [Ack(kept)]
                stored = self.coming if self.whole else self.items
                stored[seq : seq + 1] = [kept]
                if seq + 1 < self.count:
                    return [Request(seq + 1)]
                self.items = stored[: self.count]
                return [Ack(ACCEPTED)]
            case RequestList():
                return [Count(len(self.items))]
            case Request(seq):
                return [Item(seq, self.items[seq])]
        return []


def ground(url: str) -> Link:
    return Link(url, system=255, component=190)


@pytest.mark.parametrize("profile", ["strict", "ardupilot", "px4"])
def test_a_flying_vehicle_takes_it_and_flies_it(profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(changing, "PLACE_WAIT_S", 0.6)
    with flying(speedup=8.0, profile=profile) as (url,), ground(url) as link:
        wait_for_vehicle(link, 10.0)
        held = upload(link, 1, OLD)
        link.send(M.MAVLink_command_long_message(1, 1, 511, 0, 42, 200_000, 0, 0, 0, 0, 0))  # MISSION_CURRENT, often
        start(link, 1, 60.0)
        flown = leg_plan(held).sequence
        new = continued(held, flown[1], [2.0, 1.0, -2.5], [30.0, 20.0, 25.0])
        seq = until_current(link, flown[1])
        got = change(link, 1, held, new, seq)
        assert first_difference(new.items, got.items) is None
        assert first_difference(new.items, download(link, 1).items) is None
        assert until_current(link, flown[1] + 1) == flown[1] + 1


def until_current(link: Link, seq: int) -> int:
    until_s = time.monotonic() + 30.0
    while time.monotonic() < until_s:
        frame = link.receive(0.5)
        if frame is not None and frame.message.get_type() == "MISSION_CURRENT" and frame.message.seq >= seq:
            return int(frame.message.seq)
    raise AssertionError(f"item {seq} was never flown to")


def test_no_item_is_marked_to_begin_with_or_px4_would_jump_there() -> None:
    holder = Holder(lambda _, __, item: item)
    with ScriptedVehicle(holder.answer) as fake, ground(fake.url) as link:
        change(link, 1, OLD, NEW, FLYING)
    assert holder.begin_flags
    assert not any(holder.begin_flags)
    assert holder.told == []


def test_a_vehicle_that_lost_its_place_is_told_where_it_was() -> None:
    def restart(holder: Holder, seq: int, item: MissionItem) -> MissionItem:
        holder.current = 0
        return item

    holder = Holder(restart)
    with ScriptedVehicle(holder.answer) as fake, ground(fake.url) as link:
        change(link, 1, OLD, NEW, FLYING)
    assert holder.told == [FLYING]


SPOILT: dict[str, Callable[[Holder, int, MissionItem], MissionItem | int | None]] = {
    "refused": lambda _, seq, item: DENIED if seq == 0 else item,
    "refused midway, some items new": lambda _, seq, item: DENIED if seq == FLYING + 3 else item,
    "silent midway, some items new": lambda _, seq, item: None if seq == FLYING + 3 else item,
    "another item held than sent": lambda _, seq, item: replace(item, x=item.x + 900) if seq == FLYING + 2 else item,
}


@pytest.mark.parametrize("whole", [False, True], ids=["ardupilot", "px4"])
@pytest.mark.parametrize("how", SPOILT)
def test_when_it_fails_the_old_mission_stays_and_one_line_says_so(how: str, *, whole: bool) -> None:
    holder = Holder(SPOILT[how], spoilt=3 if how.startswith("silent") else 1, whole=whole)
    with ScriptedVehicle(holder.answer) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError) as caught:
            change(link, 1, OLD, NEW, FLYING)
    text = str(caught.value)
    assert text.startswith("mission not changed: ")
    assert text.endswith("; the old mission stays and is flown on")
    assert "\n" not in text
    assert first_difference(OLD.items, tuple(holder.items)) is None
    assert holder.current == FLYING


def test_a_vehicle_that_takes_neither_is_not_said_to_hold_the_old_one() -> None:
    def mixed(_: Holder, seq: int, item: MissionItem) -> MissionItem | int:
        return DENIED if seq == FLYING + 2 else replace(item, x=item.x + 900) if seq == FLYING + 1 else item

    holder = Holder(mixed, spoilt=99)
    with ScriptedVehicle(holder.answer) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match="what mission it holds now is NOT known"):
            change(link, 1, OLD, NEW, FLYING)


def test_the_missions_differ_in_what_is_to_come_only() -> None:
    assert isinstance(NEW, Mission)
    assert NEW.items[: FLYING + 1] == OLD.items[: FLYING + 1]
    assert NEW.items != OLD.items
