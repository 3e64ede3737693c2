"""The vehicle's side of a mission transfer."""

from __future__ import annotations

from exchange import OLD, OTHER, items, tell

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    ITEM_RETRIES,
    ITEM_TIMEOUT_S,
    UNSUPPORTED,
    Ack,
    ClearAll,
    Count,
    Item,
    Request,
    RequestList,
)
from dslam_mav.mav.mission.server import Server


def test_upload_replaces_the_mission_only_when_it_is_whole() -> None:
    new = items(3)
    server, replies = tell(Server(items=OLD), Count(3))
    assert replies == [Request(0)]
    for seq in range(2):
        server, replies = tell(server, Item(seq, new[seq]))
        assert replies == [Request(seq + 1)]
        assert server.items == OLD
    server, replies = tell(server, Item(2, new[2]))
    assert replies == [Ack(ACCEPTED)]
    assert server.items == new


def test_item_out_of_order_is_dropped_and_the_expected_one_asked_again() -> None:
    new = items(4)
    server, _ = tell(Server(), Count(4))
    server, replies = tell(server, Item(2, new[2]))
    assert replies == [Request(0)]
    for seq in range(4):
        server, _ = tell(server, Item(seq, new[seq]))
    assert server.items == new


def test_duplicate_of_the_item_just_taken_starts_no_second_round() -> None:
    new = items(3)
    server, _ = tell(Server(), Count(3))
    server, _ = tell(server, Item(0, new[0]))
    server, replies = tell(server, Item(0, new[0]))
    assert replies == []


def test_lost_final_ack_is_repeated_on_the_last_item_only() -> None:
    new = items(2)
    server, _ = tell(Server(), Count(2))
    for seq in range(2):
        server, _ = tell(server, Item(seq, new[seq]))
    assert tell(server, Item(1, new[1]))[1] == [Ack(ACCEPTED)]
    assert tell(server, Item(0, new[0]))[1] == []


def test_refused_item_resets_and_the_old_mission_stays() -> None:
    new = items(3)
    server, _ = tell(Server(items=OLD), Count(3))
    server, _ = tell(server, Item(0, new[0]))
    server, replies = tell(server, Item(1, new[1]), judge=lambda seq, item: UNSUPPORTED)
    assert replies == [Ack(UNSUPPORTED)]
    assert server.items == OLD
    assert tell(server, Item(2, new[2]))[1] == [Ack(ERROR)]  # a stray now
    assert tell(server, Count(1))[1] == [Request(0)]


def test_count_zero_clears() -> None:
    server, replies = tell(Server(items=OLD), Count(0))
    assert (server.items, replies) == ((), [Ack(ACCEPTED)])


def test_cancel_keeps_the_old_mission() -> None:
    server, _ = tell(Server(items=OLD), Count(3))
    server, _ = tell(server, Ack(CANCELLED))
    assert server.incoming is None
    assert server.items == OLD


def test_vehicle_asks_again_after_250_ms_for_five_seconds_then_cancels() -> None:
    server, _ = tell(Server(items=OLD), Count(3), 10.0)
    now_s = 10.0
    for _ in range(ITEM_RETRIES):
        assert tell(server, None, now_s + ITEM_TIMEOUT_S - 1e-3)[1] == []
        now_s += ITEM_TIMEOUT_S
        server, replies = tell(server, None, now_s)
        assert replies == [Request(0)]
    now_s += ITEM_TIMEOUT_S
    assert now_s == 15.0
    server, replies = tell(server, None, now_s)
    assert replies == [Ack(CANCELLED)]
    assert server.items == OLD
    assert server.incoming is None


def test_a_second_station_may_read_but_not_write_meanwhile() -> None:
    new = items(2)
    server, _ = tell(Server(items=OLD), Count(2))
    assert tell(server, Count(1), peer=OTHER)[1] == [Ack(DENIED)]
    assert tell(server, ClearAll(), peer=OTHER)[1] == [Ack(DENIED)]
    server, replies = tell(server, RequestList(), peer=OTHER)
    assert replies == [Count(2)]
    assert tell(server, Request(1), peer=OTHER)[1] == [Item(1, OLD[1])]
    for seq in range(2):
        server, _ = tell(server, Item(seq, new[seq]))
    assert server.items == new


def test_request_past_the_end_is_an_invalid_sequence() -> None:
    assert tell(Server(items=OLD), Request(2))[1] == [Ack(INVALID_SEQUENCE)]


def test_in_flight_a_mission_may_be_replaced_but_not_cleared() -> None:
    server = Server(items=OLD, locked=True)
    assert tell(server, Count(0))[1] == [Ack(DENIED)]
    assert tell(server, ClearAll())[1] == [Ack(DENIED)]
    assert tell(server, RequestList())[1] == [Count(2)]
    server, replies = tell(server, Count(1))
    assert replies == [Request(0)]
    assert server.items == OLD
