"""Both sides of a mission transfer over a channel that loses, doubles and delays."""

from __future__ import annotations

import heapq
import itertools
import random

from exchange import GROUND, OLD, OTHER, accept, items
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    CANCELLED,
    ERROR,
    Ack,
    ClearAll,
    Count,
    Item,
    Message,
    Phase,
    Request,
    RequestList,
    Transfer,
    begin_download,
    begin_upload,
    step_download,
    step_upload,
)
from dslam_mav.mav.mission.server import Server, step_server


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
