"""The ground's side of a mission transfer."""

from __future__ import annotations

import pytest
from exchange import OLD, items

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    DENIED,
    INVALID_SEQUENCE,
    ITEM_TIMEOUT_S,
    RETRIES,
    TIMEOUT_S,
    UNSUPPORTED,
    Ack,
    ClearAll,
    Count,
    Item,
    Phase,
    Request,
    RequestList,
    begin_clear,
    begin_download,
    begin_upload,
    result_in_words,
    step_clear,
    step_download,
    step_upload,
)


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
