"""Logs that were cut or damaged: everything whole is read, nothing changed is passed on, nothing crashes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, Writer

from dslam_mav.errors import BadInputError
from dslam_mav.log import FlightLog, log_info, read_log


def chunk_spans(path: Path) -> list[tuple[int, int, int]]:
    """(start, end, messages) of every chunk, by the library's own index."""
    with path.open("rb") as file:
        reader = make_reader(file)
        messages = Counter()
        spans = [
            (c.chunk_start_offset, c.chunk_start_offset + c.chunk_length) for c in reader.get_summary().chunk_indexes
        ]
    data = path.read_bytes()
    for start, end in spans:
        messages[start] = _messages(data[start:end])
    return [(start, end, messages[start]) for start, end in spans]


def _messages(chunk: bytes) -> int:
    from io import BytesIO

    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    records = StreamReader(BytesIO(chunk), skip_magic=True).records
    count = 0
    try:
        for record in records:
            count += isinstance(record, Message)
    except Exception:  # the piece ends where a file would go on
        pass
    return count


def contents(log: FlightLog) -> dict[str, list[object]]:
    """All messages in comparable form, by kind."""
    return {
        "frames": list(log.frames),
        "readings": list(log.readings),
        "progress": list(log.progress),
        "texts": list(log.texts),
        "estimates": [
            (
                e.received_ns,
                e.legs_flown,
                e.estimate.sources.position_m.tobytes(),
                e.estimate.residual.tobytes(),
            )
            for e in log.estimates
        ],
    }


def is_part_of(part: list[object], whole: list[object]) -> bool:
    """Whether `part` is `whole` with nothing changed, added or moved, only left out."""
    rest = iter(whole)
    return all(any(item == other for other in rest) for item in part)


def check(damaged: Path, original: FlightLog) -> FlightLog:
    log = read_log(damaged)
    assert not log.complete
    whole = contents(original)
    for kind, part in contents(log).items():
        assert is_part_of(part, whole[kind]), kind
    for name, data in log.attachments.items():
        assert original.attachments[name] == data
    assert log.truth is None or log.truth.amplitude.tolist() == original.truth.amplitude.tolist()
    info = log_info(damaged)
    assert not info["complete"]
    assert info["topics"] == log.topics
    return log


def test_a_cut_log_keeps_every_whole_chunk(flight, tmp_path):
    data, original, spans = flight.read_bytes(), read_log(flight), chunk_spans(flight)
    assert len(spans) > 5
    rng = np.random.default_rng(2)
    edges = [edge + step for _, edge, _ in spans for step in (-1, 0, 1)]
    places = {8, 9, len(data) - 1, len(data) - 8, *edges, *rng.integers(8, len(data), 60).tolist()}
    for place in sorted(places):
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:place])
        log = check(cut, original)
        assert sum(log.topics.values()) == sum(n for _, end, n in spans if end <= place)


def test_a_flipped_bit_costs_one_chunk_at_most(flight, tmp_path):
    data, original, spans = flight.read_bytes(), read_log(flight), chunk_spans(flight)
    rng = np.random.default_rng(3)
    starts = [start + step for start, _, _ in spans for step in (0, 2, 5, 12, 27, 30, 34, 38, 41, 49)]
    indexes = [end + step for _, end, _ in spans for step in (0, 3, 11)]
    places = [*rng.integers(8, len(data), 60).tolist(), *starts, *indexes, len(data) - 1, len(data) - 20]
    whole = sum(n for _, _, n in spans)
    for place in places:
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        path = tmp_path / "flipped.mcap"
        path.write_bytes(damaged)
        log = check(path, original)
        lost = sum(n for start, end, n in spans if start <= place < end)
        assert sum(log.topics.values()) >= whole - lost


def test_overwritten_stretches_cost_only_what_they_hit(flight, tmp_path):
    data, original, spans = flight.read_bytes(), read_log(flight), chunk_spans(flight)
    rng = np.random.default_rng(4)
    whole = sum(n for _, _, n in spans)
    for _ in range(20):
        start = int(rng.integers(8, len(data)))
        end = min(len(data), start + int(rng.integers(1, 20_000)))
        filler = rng.bytes(end - start) if rng.random() < 0.5 else bytes(end - start)
        path = tmp_path / "overwritten.mcap"
        path.write_bytes(data[:start] + filler + data[end:])
        log = check(path, original)
        lost = sum(n for a, b, n in spans if a < end and start < b)
        assert sum(log.topics.values()) >= whole - lost


def test_without_the_chunk_that_declares_the_channels_the_rest_is_read(flight, tmp_path):
    data, original = flight.read_bytes(), read_log(flight)
    start, end, n = chunk_spans(flight)[0]
    path = tmp_path / "headless.mcap"
    path.write_bytes(data[:start] + data[end:])
    log = check(path, original)
    assert sum(log.topics.values()) == sum(original.topics.values()) - n
    assert len(log.readings) > 0.7 * len(original.readings)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "empty"),
        (MCAP0_MAGIC[:5], "begins with"),
        (b"time_s,value\n0,1\n", "begins with"),
        (b"\x00" * 100, "begins with"),
    ],
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path, content, says):
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    for read in (read_log, log_info):
        with pytest.raises(BadInputError) as caught:
            read(path)
        text = str(caught.value)
        assert str(path) in text
        assert says in text
        assert "\n" not in text


def test_a_folder_and_a_missing_file_are_refused(tmp_path):
    with pytest.raises(BadInputError, match="no file"):
        read_log(tmp_path)
    with pytest.raises(BadInputError, match=r"missing\.mcap.*no such file"):
        read_log(tmp_path / "missing.mcap")
    with pytest.raises(BadInputError, match="no file"):
        read_log(Path("/dev/null"))


def test_foreign_topics_are_counted_and_left_alone(tmp_path):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("some.Type", "jsonschema", b"{}")
        for topic in ("/thermal", "/camera"):
            channel = writer.register_channel(topic, "json", schema)
            for i in range(3):
                writer.add_message(channel, 10**9 * i, b'{"value": 1}', 0)
        writer.finish()
    log = read_log(path)
    assert log.topics == {"/thermal": 3, "/camera": 3}
    assert log.readings == ()
    assert log.duration_s == 2.0
    assert log.complete


def test_an_empty_log_is_a_log(tmp_path):
    path = tmp_path / "empty.mcap"
    path.write_bytes(MCAP0_MAGIC)
    assert log_info(path) == {"topics": {}, "duration_s": 0.0, "complete": False}
