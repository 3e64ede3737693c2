from __future__ import annotations

import heapq
import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    ITEM_TIMEOUT_S,
    RETRIES,
    TIMEOUT_S,
    UNSUPPORTED,
    Ack,
    ClearAll,
    Count,
    Item,
    Message,
    Phase,
    Request,
    RequestList,
    Transfer,
    begin_clear,
    begin_download,
    begin_upload,
    result_in_words,
    step_clear,
    step_download,
    step_upload,
)
from dslam_mav.mav.mission.server import Server, step_server
from dslam_mav.mission import MissionItem

GROUND = "ground"
OTHER = "another station"
OLD = tuple(MissionItem(16, 3, (9.0, 0, 0, 0), 9, 9, float(k)) for k in range(2))


def items(n: int) -> tuple[MissionItem, ...]:
    return tuple(MissionItem(16, 3, (0.0, 0, 0, 0), 100 + k, 200 + k, 10.0) for k in range(n))


def accept(seq: int, item: MissionItem) -> int:
    return ACCEPTED


def tell(server: Server, message: Message | None, now_s: float = 0.0, peer: str = GROUND, judge=accept):
    server, replies = step_server(server, peer, message, now_s, judge)
    return server, [reply for _, reply in replies]


# ---- the vehicle's side


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


def test_vehicle_asks_again_every_250_ms_five_times_then_cancels() -> None:
    server, _ = tell(Server(items=OLD), Count(3), 10.0)
    now_s = 10.0
    for _ in range(RETRIES):
        assert tell(server, None, now_s + ITEM_TIMEOUT_S - 1e-3)[1] == []
        now_s += ITEM_TIMEOUT_S
        server, replies = tell(server, None, now_s)
        assert replies == [Request(0)]
    server, replies = tell(server, None, now_s + ITEM_TIMEOUT_S)
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


def test_no_changes_in_flight() -> None:
    server = Server(items=OLD, locked=True)
    assert tell(server, Count(1))[1] == [Ack(DENIED)]
    assert tell(server, ClearAll())[1] == [Ack(DENIED)]
    assert tell(server, RequestList())[1] == [Count(2)]


# ---- the ground's side


def test_count_is_sent_again_every_1500_ms_and_five_times_at_most() -> None:
    state, replies = begin_upload(items(2), 0.0)
    sent, now_s = list(replies), 0.0
    while not state.phase.ended:
        assert step_upload(state, None, state.deadline_s - 1e-3)[1] == ()
        now_s = state.deadline_s
        state, replies = step_upload(state, None, now_s)
        sent += replies
    assert sent == [Count(2)] * (1 + RETRIES)
    assert state.phase is Phase.SILENT
    assert now_s == pytest.approx(TIMEOUT_S * (1 + RETRIES))


def test_any_item_is_sent_again_when_asked_again() -> None:
    new = items(3)
    state, _ = begin_upload(new, 0.0)
    for seq in (0, 1, 1, 0, 2):
        state, replies = step_upload(state, Request(seq), 0.1)
        assert replies == (Item(seq, new[seq]),)
    assert step_upload(state, Request(3), 0.1)[1] == ()
    assert step_upload(state, Ack(ACCEPTED), 0.1)[0].phase is Phase.DONE


def test_accepted_before_the_last_item_was_asked_for_is_not_the_end() -> None:
    state, _ = begin_upload(items(3), 0.0)
    state, _ = step_upload(state, Request(0), 0.1)
    state, _ = step_upload(state, Ack(ACCEPTED), 0.1)
    assert not state.phase.ended


def test_invalid_sequence_is_not_final_other_errors_are() -> None:
    state, _ = begin_upload(items(3), 0.0)
    state, _ = step_upload(state, Request(0), 0.1)
    state, _ = step_upload(state, Ack(INVALID_SEQUENCE), 0.1)
    assert not state.phase.ended
    state, _ = step_upload(state, Ack(UNSUPPORTED), 0.1)
    assert (state.phase, state.result, state.seq) == (Phase.REFUSED, UNSUPPORTED, 0)


def test_lost_final_ack_leaves_the_upload_unconfirmed_not_failed() -> None:
    state, _ = begin_upload(items(1), 0.0)
    state, _ = step_upload(state, Request(0), 0.1)
    while not state.phase.ended:
        state, replies = step_upload(state, None, state.deadline_s)
        assert replies == ()
    assert state.phase is Phase.UNCONFIRMED


def test_download_asks_in_order_and_confirms() -> None:
    state, replies = begin_download(0.0)
    assert replies == (RequestList(),)
    state, replies = step_download(state, Count(2), 0.0)
    assert replies == (Request(0),)
    state, replies = step_download(state, Item(1, OLD[1]), 0.0)
    assert replies == (Request(0),)  # out of order: dropped
    state, replies = step_download(state, None, ITEM_TIMEOUT_S)
    assert replies == (Request(0),)
    state, replies = step_download(state, Item(0, OLD[0]), 0.3)
    state, replies = step_download(state, Item(1, OLD[1]), 0.3)
    assert replies == (Ack(ACCEPTED),)
    assert (state.phase, state.items) == (Phase.DONE, OLD)


def test_download_of_nothing_is_an_empty_mission() -> None:
    state, replies = step_download(begin_download(0.0)[0], Count(0), 0.0)
    assert (state.phase, state.items, replies) == (Phase.DONE, (), (Ack(ACCEPTED),))


def test_clear() -> None:
    state, _ = begin_clear(0.0)
    state, replies = step_clear(state, None, TIMEOUT_S)
    assert replies == (ClearAll(),)
    assert step_clear(state, Ack(ACCEPTED), 2.0)[0].phase is Phase.DONE
    assert step_clear(state, Ack(DENIED), 2.0)[0].phase is Phase.REFUSED


def test_every_result_has_words() -> None:
    assert len({result_in_words(k) for k in range(16)}) == 16
    assert result_in_words(99) == "result 99"


# ---- both ends over a channel that loses, doubles and delays


class Channel:
    """Runs one transfer against a vehicle in simulated time; `radio` decides every packet's fate."""

    def __init__(self, server: Server, radio: random.Random, loss: float, double: float, delay_s: float) -> None:
        self.server, self.radio = server, radio
        self.loss, self.double, self.delay_s = loss, double, delay_s
        self.now_s = 0.0
        self.queue: list[tuple[float, int, bool, Message]] = []
        self.order = itertools.count()

    def send(self, to_vehicle: bool, message: Message) -> None:
        for _ in range(1 + (self.radio.random() < self.double)):
            if self.radio.random() >= self.loss:
                at_s = self.now_s + self.radio.random() * self.delay_s
                heapq.heappush(self.queue, (at_s, next(self.order), to_vehicle, message))

    def run(self, begun, step) -> Transfer:
        state, replies = begun
        for reply in replies:
            self.send(True, reply)
        while not state.phase.ended:
            next_s = min(state.deadline_s, self.server.deadline_s)
            if self.queue and self.queue[0][0] <= next_s:
                self.now_s, _, to_vehicle, message = heapq.heappop(self.queue)
            else:
                self.now_s, to_vehicle, message = next_s, True, None
                state, replies = step(state, None, self.now_s)
                for reply in replies:
                    self.send(True, reply)
            if to_vehicle:
                self.server, answers = step_server(self.server, GROUND, message, self.now_s, accept)
                for _, answer in answers:
                    self.send(False, answer)
            else:
                state, replies = step(state, message, self.now_s)
                for reply in replies:
                    self.send(True, reply)
            assert len(self.queue) < 10_000, "packets breed"
        return state


@settings(max_examples=150, deadline=None)
@given(
    n=st.integers(0, 12),
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.1, 0.3, 0.6]),
    double=st.sampled_from([0.0, 0.3]),
    delay_s=st.sampled_from([0.0, 0.05, 0.4]),
)
def test_whatever_the_radio_does_the_mission_is_whole_or_the_failure_told(
    n: int, seed: int, loss: float, double: float, delay_s: float
) -> None:
    new = items(n)
    channel = Channel(Server(items=OLD), random.Random(seed), loss, double, delay_s)
    up = channel.run(begin_upload(new, 0.0), step_upload)
    assert channel.server.items in (OLD, new)  # never a part, never a mixture
    if up.phase is Phase.DONE:
        assert channel.server.items == new
    down = channel.run(begin_download(channel.now_s), step_download)
    if down.phase is Phase.DONE:
        assert down.items in (OLD, new)
        if up.phase is Phase.DONE:
            assert down.items == new
    if loss == 0.0 and delay_s < 0.2:
        assert (up.phase, down.phase) == (Phase.DONE, Phase.DONE)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_no_sequence_of_messages_leaves_a_mission_nobody_sent(data: st.DataObject) -> None:
    new = items(4)
    message = st.one_of(
        st.none(),
        st.builds(Count, st.integers(0, 5)),
        st.integers(0, 3).map(lambda k: Item(k, new[k])),
        st.builds(Ack, st.sampled_from([ACCEPTED, ERROR, CANCELLED])),
        st.just(RequestList()),
        st.builds(Request, st.integers(0, 5)),
        st.just(ClearAll()),
    )
    server, now_s = Server(items=OLD), 0.0
    for _ in range(data.draw(st.integers(0, 40))):
        now_s += data.draw(st.sampled_from([0.0, 0.1, 0.3]))
        peer = data.draw(st.sampled_from([GROUND, OTHER]))
        server, replies = step_server(server, peer, data.draw(message), now_s, accept)
        # what is held is what one station sent in full, from its first item on
        assert server.items in (OLD, *(new[:k] for k in range(5)))
        assert len(replies) <= 1
