"""A cut or damaged log -> a whole one with all of it that can be trusted, and what is lost."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Attachment, Metadata
from mcap.writer import CompressionType, Writer

from dslam_mav.errors import LogError
from dslam_mav.log.declared import Declared, Message, is_ours
from dslam_mav.log.reader import file_bytes
from dslam_mav.log.recorder import CHUNK_BYTES
from dslam_mav.log.recovered import Recovered, as_metadata
from dslam_mav.log.scan import Chunk, Scan
from dslam_mav.log.topics import PRODUCER


@dataclass(frozen=True, slots=True)
class Count:
    """Messages of a topic; not `exact`: at least so many are lost, nobody knows how many more."""

    kept: int
    lost: int
    exact: bool


@dataclass(frozen=True, slots=True)
class Salvaged:
    """What a log still held.

    `data` is the log written anew, indexed and closed. `closed`: the damaged one had been closed. `unread`: chunks
    left out because they have no checksum, or are compressed with lz4.
    """

    data: bytes
    topics: dict[str, Count]
    attachments: tuple[str, ...]
    lost_attachments: tuple[str, ...]
    lost_metadata: tuple[str, ...]
    closed: bool
    unread: int

    @property
    def kept(self) -> int:
        """Messages kept."""
        return sum(count.kept for count in self.topics.values())

    @property
    def lost(self) -> int:
        """Messages known to be lost."""
        return sum(count.lost for count in self.topics.values())

    @property
    def exact(self) -> bool:
        """Whether no more messages than those are lost."""
        return self.closed and all(count.exact for count in self.topics.values())

    @property
    def clean(self) -> bool:
        """Whether nothing is lost, for certain."""
        return self.exact and not (self.lost or self.lost_attachments or self.lost_metadata or self.unread)


def salvage(path: Path) -> Salvaged:
    """All of a log whose checksums hold; BadInputError where it cannot be read, LogError where nothing is left."""
    data = file_bytes(path)
    scan = Scan(data)
    found = _find(scan, data)
    if not (found.messages or found.attachments or scan.complete):
        raise LogError(f"{path}: nothing can be salvaged: no chunk and no attachment of an MCAP log is whole in it")
    topics = _counts(scan, found)
    known = scan.summary
    salvaged = Salvaged(
        data=b"",
        topics=topics,
        attachments=tuple(attachment.name for attachment in found.attachments),
        lost_attachments=_missing(known.attachments if known else (), (a.name for a in found.attachments)),
        lost_metadata=_missing(known.metadata if known else (), (m.name for m in found.metadata)),
        closed=known is not None or scan.unbroken,
        unread=scan.unread,
    )
    source = path.name.encode("utf-8", "replace").decode()  # any bytes may name a file
    note = Recovered(source=source, kept=salvaged.kept, lost=salvaged.lost, exact=salvaged.exact)
    return replace(salvaged, data=_written(scan, found, note))


@dataclass(slots=True)
class _Found:
    """What is whole. `undeclared`: messages by channel of which the log no longer tells what they are."""

    declared: Declared
    messages: list[Message] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    kept: Counter[int] = field(default_factory=Counter)
    undeclared: Counter[int] = field(default_factory=Counter)
    contradictory: int = 0


def _find(scan: Scan, data: bytes) -> _Found:
    found = _Found(Declared(scan.summary, ours=is_ours(scan.library, data)))
    chunks: list[Chunk] = []
    for piece in scan:
        if isinstance(piece, Attachment):
            found.attachments.append(piece)
        elif isinstance(piece, Metadata):
            found.metadata.append(piece)
        else:
            chunks.append(piece)
    if not scan.complete:  # damage may bring the same record twice
        found.attachments = [a for i, a in enumerate(found.attachments) if a not in found.attachments[:i]]
    read: list[Message] = []
    for chunk in chunks:
        try:
            read.extend(found.declared.messages(chunk.records))
        except (struct.error, ValueError, McapError):
            found.contradictory += 1
    numbers = set(found.declared.numbers())
    found.messages = [message for message in read if message[0] in numbers]
    found.kept.update(message[0] for message in found.messages)
    found.undeclared.update(message[0] for message in read if message[0] not in numbers)
    return found


def _counts(scan: Scan, found: _Found) -> dict[str, Count]:
    """By topic: kept, and lost as the summary knows, or else at least what numbers and indexes tell."""
    stated = scan.summary.counts if scan.summary else None
    numbered = found.declared.numbered if found.declared.ours else {}
    whole = scan.unbroken and not found.contradictory
    names = {number: found.declared.channel(number)[0].topic for number in found.declared.numbers()}
    topics: dict[str, Count] = {}
    empty = () if whole or stated is not None else names  # who knows
    seen = {*(stated or ()), *numbered, *found.kept, *found.undeclared, *scan.damaged_messages, *empty}
    for channel in sorted(seen):
        kept = found.kept[channel]
        if stated is not None:
            lost, exact = stated.get(channel, 0) - kept, True
        else:
            lost = max(numbered.get(channel, 0) - kept, scan.damaged_messages[channel], found.undeclared[channel])
            exact = whole and lost <= 0
        topic = names.get(channel, f"channel {channel}")
        before = topics.get(topic, Count(0, 0, True))
        topics[topic] = Count(before.kept + kept, before.lost + max(0, lost), before.exact and exact)
    return topics


def _missing(stated: Iterable[str], kept: Iterable[str]) -> tuple[str, ...]:
    return tuple((Counter(stated) - Counter(kept)).elements())


def _written(scan: Scan, found: _Found, note: Recovered) -> bytes:
    """The log anew: channels in their old order, messages in theirs and with their numbers."""
    out = BytesIO()
    writer: Any = Writer(out, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True)
    ours = found.declared.ours
    writer.start(scan.profile, scan.library or (f"{PRODUCER} unknown" if ours else f"recovered by {PRODUCER}"))
    for attachment in found.attachments:
        writer.add_attachment(
            attachment.create_time, attachment.log_time, attachment.name, attachment.media_type, attachment.data
        )
    for metadata in found.metadata:
        writer.add_metadata(metadata.name, metadata.metadata)
    writer.add_metadata(*as_metadata(note))
    channels = _registered(writer, found.declared)
    for channel, sequence, time_ns, publish_ns, data in found.messages:
        writer.add_message(channels[channel], time_ns, data, publish_ns, sequence)
    writer.finish()
    return out.getvalue()


def _registered(writer: Any, declared: Declared) -> dict[int, int]:
    """Every channel that is known, with its schema; its new number by its old one, which in our logs is the same."""
    schemas, channels = {0: 0}, {}
    for number in declared.numbers():
        channel, schema = declared.channel(number)
        if schema is not None and schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        new = writer.register_channel(
            channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
        )
        channels[number] = new
    return channels
