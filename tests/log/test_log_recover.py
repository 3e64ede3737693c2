"""A damaged log recovered: all of it whose checksums hold, as any reader opens it, and an honest count of the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from dslam_mav.errors import BadInputError, LogError
from dslam_mav.log import log_info, read_log
from dslam_mav.log.recover import Salvaged, salvage

CASES = 500

Row = tuple[str, int, int, int, bytes]


def rows(path: Path) -> list[Row]:
    """Every message, by the library's own readers, which have to agree, all checksums checked."""
    found = []
    for reader in (make_reader, NonSeekingReader):
        with path.open("rb") as file:
            found.append(
                [
                    (channel.topic, m.sequence, m.log_time, m.publish_time, m.data)
                    for _, channel, m in reader(file, validate_crcs=True).iter_messages(log_time_order=False)
                ]
            )
    assert found[0] == found[1]
    return found[0]


def attached(path: Path) -> dict[str, bytes]:
    """Attachments as the library finds them by their index; it cannot read empty ones."""
    with path.open("rb") as file:
        return {a.name: a.data for a in make_reader(file, validate_crcs=True).iter_attachments()}


@pytest.fixture
def recovered(tmp_path: Path) -> Callable[[bytes], tuple[Salvaged, Path]]:
    """Recovers the bytes of a file."""

    def recover(data: bytes) -> tuple[Salvaged, Path]:
        damaged, out = tmp_path / "damaged.mcap", tmp_path / "out.mcap"
        damaged.write_bytes(data)
        salvaged = salvage(damaged)
        out.write_bytes(salvaged.data)
        return salvaged, out

    return recover


def spans(path: Path) -> list[tuple[int, int]]:
    """(start, end) of every chunk."""
    with path.open("rb") as file:
        indexes = make_reader(file).get_summary().chunk_indexes
    return [(c.chunk_start_offset, c.chunk_start_offset + c.chunk_length) for c in indexes]


def unclosed(path: Path) -> bytes:
    """The log as a kill leaves it: all chunks with their indexes, no end."""
    with path.open("rb") as file:
        last = make_reader(file).get_summary().chunk_indexes[-1]
    return path.read_bytes()[: last.chunk_start_offset + last.chunk_length + last.message_index_length]


def damages(data: bytes) -> Iterator[bytes]:
    """Bit flips, cuts, zeroed blocks, garbage in between, lost stretches and stretches twice; seeded."""
    rng = np.random.default_rng(6)
    for case in range(CASES):
        place = int(rng.integers(len(data)))
        more = int(rng.integers(1, 4096))
        match case % 8:
            case 0 | 1 | 2:
                flipped = bytearray(data)
                flipped[place] ^= 1 << int(rng.integers(8))
                yield bytes(flipped)
            case 3 | 4:
                yield data[:place]
            case 5:
                yield data[:place] + bytes(min(more, len(data) - place)) + data[place + more :]
            case 6:
                yield data[:place] + rng.bytes(more) + data[place:]
            case 7:
                again = data[place : place + more] if case % 16 == 7 else b""
                yield data[:place] + again + again + data[place + more :]


def test_five_hundred_damages_never_pass_on_what_was_not_recorded(small_chunks, tmp_path, recovered):
    data, original = small_chunks.read_bytes(), rows(small_chunks)
    order = {row: i for i, row in enumerate(original)}
    assert len(order) == len(original)
    attachments = attached(small_chunks) | {"empty": b""}
    topics = Counter(row[0] for row in original)
    lossless = nothing = 0
    for damaged in damages(data):
        try:
            salvaged, out = recovered(damaged)
        except LogError:
            nothing += 1
            continue
        kept = rows(out)
        places = [order[row] for row in kept]  # nothing that was not recorded
        assert places == sorted(set(places))  # in its order, and once
        assert attached(out).items() <= attachments.items()
        assert {t: c.kept for t, c in salvaged.topics.items() if c.kept} == Counter(row[0] for row in kept)
        for topic, count in salvaged.topics.items():
            assert count.kept + count.lost <= topics[topic]
            if salvaged.exact:
                assert count.kept + count.lost == topics[topic]
        if salvaged.clean:
            lossless += 1
            assert kept == original
        same_for_our_reader(tmp_path / "damaged.mcap", out)
    assert nothing < CASES / 20
    assert CASES / 20 < lossless < CASES / 2


def same_for_our_reader(damaged: Path, out: Path) -> None:
    """Read as it is, a damaged log gives what it gives recovered; where its first bytes are damaged it is refused."""
    after = read_log(out)
    assert after.complete
    if damaged.read_bytes()[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
        with pytest.raises(BadInputError):
            read_log(damaged)
        return
    before = read_log(damaged)
    assert before.frames == after.frames
    assert before.readings == after.readings
    assert before.topics == after.topics == log_info(damaged)["topics"]
    assert before.attachments == after.attachments


def test_a_whole_log_comes_out_as_it_is(small_chunks, recovered):
    salvaged, out = recovered(small_chunks.read_bytes())
    assert (salvaged.clean, salvaged.lost, salvaged.exact) == (True, 0, True)
    assert rows(out) == rows(small_chunks)
    with small_chunks.open("rb") as before, out.open("rb") as after:
        theirs, ours = make_reader(before), make_reader(after)
        assert ours.get_header() == theirs.get_header()
        assert ours.get_summary().schemas == theirs.get_summary().schemas
        assert ours.get_summary().channels == theirs.get_summary().channels
        assert ours.get_summary().statistics.channel_message_counts == (
            theirs.get_summary().statistics.channel_message_counts
        )
        assert {(a.name, a.media_type, a.create_time) for a in ours.get_summary().attachment_indexes} == {
            (a.name, a.media_type, a.create_time) for a in theirs.get_summary().attachment_indexes
        }
    log = read_log(out)
    assert log.recovered == {"source": "damaged.mcap", "kept": salvaged.kept, "lost": 0, "exact": True}
    assert log.attachments == read_log(small_chunks).attachments
    assert read_log(small_chunks).recovered is None


def test_a_closed_log_knows_its_losses_exactly(small_chunks, recovered):
    data, original = bytearray(small_chunks.read_bytes()), rows(small_chunks)
    start, end = spans(small_chunks)[4]
    data[(start + end) // 2] ^= 1
    salvaged, out = recovered(bytes(data))
    gone = Counter(original) - Counter(rows(out))
    assert gone
    assert (salvaged.lost, salvaged.exact, salvaged.clean) == (gone.total(), True, False)
    by_topic = Counter(row[0] for row in gone)
    assert {topic: count.lost for topic, count in salvaged.topics.items() if count.lost} == by_topic


def test_a_log_never_closed_counts_the_gaps_and_does_not_guess_its_end(small_chunks, recovered):
    data, original = bytearray(unclosed(small_chunks)), rows(small_chunks)
    clean, _ = recovered(bytes(data))
    assert (clean.kept, clean.lost, clean.exact, clean.clean) == (len(original), 0, False, False)
    start, end = spans(small_chunks)[4]
    data[(start + end) // 2] ^= 1
    salvaged, out = recovered(bytes(data))
    assert salvaged.lost == len(original) - len(rows(out)) > 0
    assert not salvaged.exact
    last = spans(small_chunks)[-1]
    salvaged, out = recovered(bytes(data)[: last[1] - 1])
    assert 0 < salvaged.lost < len(original) - len(rows(out))  # the torn chunk at the end is not counted


@pytest.mark.parametrize("close", [True, False])
def test_without_its_first_chunk_a_log_still_knows_its_channels(small_chunks, recovered, close):
    data = small_chunks.read_bytes() if close else unclosed(small_chunks)
    start, end = spans(small_chunks)[0]
    salvaged, out = recovered(data[:start] + bytes(end - start) + data[end:])
    original = rows(small_chunks)
    assert rows(out) == original[-salvaged.kept :]
    assert salvaged.kept == len(original) - 1  # that chunk held the truth alone
    truth = salvaged.topics["/truth"]
    assert (truth.kept, truth.lost, truth.exact) == ((0, 1, True) if close else (0, 0, False))
    assert len(read_log(out).frames) > 200


def test_with_its_first_blocks_zeroed_a_log_is_still_known_by_its_packets(small_chunks, recovered, tmp_path):
    data = unclosed(small_chunks)
    _, end = spans(small_chunks)[0]
    salvaged, out = recovered(bytes(end) + data[end:])
    original = rows(small_chunks)
    assert rows(out) == original[-salvaged.kept :]
    whole_magic = tmp_path / "magic.mcap"
    whole_magic.write_bytes(MCAP0_MAGIC + bytes(end - len(MCAP0_MAGIC)) + data[end:])
    assert read_log(whole_magic).frames == read_log(out).frames


def test_a_log_recovered_can_be_damaged_and_recovered_again(small_chunks, recovered, tmp_path):
    data = bytearray(unclosed(small_chunks))
    start, end = spans(small_chunks)[0]
    data[(start + end) // 2] ^= 1
    first, out = recovered(bytes(data))
    again = tmp_path / "again.mcap"
    again.write_bytes(out.read_bytes())
    second, out = recovered(again.read_bytes())
    assert second.clean
    assert second.kept == first.kept
    assert rows(out) == rows(again)


def foreign(path: Path, **settings: object) -> None:
    """Somebody else's log: numbers of its own, metadata, a channel without a schema."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=400, **settings)  # type: ignore[arg-type]
        writer.start(profile="ros2", library="theirs")
        schema = writer.register_schema("some.Type", "jsonschema", b"{}")
        one = writer.register_channel("/one", "json", schema, {"robot": "a"})
        two = writer.register_channel("/two", "raw", 0)
        writer.add_metadata("mission", {"pilot": "Ä", "": ""})
        writer.add_attachment(3, 4, "notes.txt", "text/plain", b"notes")
        for i in range(100):
            writer.add_message(one, i, b'{"i": %d}' % i, i)
            writer.add_message(two, i, b"%d" % i, 0)
        writer.finish()


def test_a_foreign_log_keeps_everything(tmp_path, recovered):
    path = tmp_path / "foreign.mcap"
    foreign(path)
    salvaged, out = recovered(path.read_bytes())
    assert salvaged.clean
    assert rows(out) == rows(path)
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert (reader.get_header().profile, reader.get_header().library) == ("ros2", "theirs")
        assert reader.get_summary().channels[1].metadata == {"robot": "a"}
        assert {m.name: m.metadata for m in reader.iter_metadata()}["mission"] == {"pilot": "Ä", "": ""}
    last = spans(path)[-2]
    cut, out = recovered(path.read_bytes()[: last[1]])
    assert not cut.exact
    assert rows(out) == rows(path)[: cut.kept]
    damaged = bytearray(unclosed(path))
    damaged[last[0] + 60] ^= 1
    salvaged, out = recovered(bytes(damaged))
    assert salvaged.lost == 200 - len(rows(out)) > 0  # by the indexes behind the damaged chunk


def test_what_nothing_vouches_for_is_left_out_and_said(tmp_path, recovered):
    path = tmp_path / "foreign.mcap"
    foreign(path, enable_crcs=False)
    salvaged, _ = recovered(path.read_bytes())
    assert (salvaged.kept, salvaged.clean) == (0, False)
    assert salvaged.unread == len(spans(path))
    foreign(path, compression=CompressionType.LZ4)
    salvaged, _ = recovered(path.read_bytes())
    assert (salvaged.kept, salvaged.lost, salvaged.exact) == (0, 200, True)


@pytest.mark.parametrize("data", [b"", MCAP0_MAGIC, bytes(5000), b"time_s,value\n0,1\n", MCAP0_MAGIC + b"\x01" * 999])
def test_where_nothing_is_left_that_is_said_in_one_line(recovered, data):
    with pytest.raises(LogError, match=r"damaged\.mcap: nothing can be salvaged") as caught:
        recovered(data)
    assert "\n" not in str(caught.value)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.binary(max_size=300), st.data())
def test_bytes_of_any_kind_around_a_log_crash_nothing(small_chunks, recovered, before, after, draw):
    data = small_chunks.read_bytes()
    start = draw.draw(st.integers(0, len(data)))
    end = draw.draw(st.integers(start, len(data)))
    original = Counter(rows(small_chunks))
    try:
        _, out = recovered(before + data[start:end] + after)
    except LogError:
        return
    assert Counter(rows(out)) <= original
