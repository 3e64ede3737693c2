"""Connection URLs, as pymavlink writes them: taken apart and judged, nothing opened. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from dslam_mav.errors import BadInputError

KINDS_LINK = ("udpin", "udpout", "tcp")
KINDS_LISTEN = ("udpin", "tcpin")


@dataclass(frozen=True, slots=True)
class Url:
    """`kind` is udpin, udpout, tcp, tcpin or serial (the device is then `host`, the baud rate `port`)."""

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host},{self.port}" if self.kind == "serial" else f"{self.kind}:{self.host}:{self.port}"


def parse_url(text: str, kinds: tuple[str, ...] = KINDS_LINK) -> Url:
    """The URL's parts; BadInputError names the part that is wrong and what would be right.

    Port 0 (any free port) is for listening kinds only. Serial devices (`/dev/ttyACM0,57600`) are accepted
    where connecting kinds are.
    """
    if text.startswith("/") and kinds is KINDS_LINK:
        return _serial(text)
    kind, _, rest = text.partition(":")
    host, _, port_text = rest.rpartition(":")
    shapes = ", ".join(f"{k}:HOST:PORT" for k in kinds) + (", /dev/ttyX,BAUD" if kinds is KINDS_LINK else "")
    if kind not in kinds:
        raise BadInputError(f"connection URL {text!r}: kind {kind!r}: expected {shapes}")
    if not host or any(c.isspace() for c in host):
        raise BadInputError(f"connection URL {text!r}: host {host!r}: expected {shapes}")
    lowest = 0 if kind in KINDS_LISTEN else 1
    port = int(port_text) if port_text.isascii() and port_text.isdigit() else -1
    if not lowest <= port <= 65535:
        raise BadInputError(f"connection URL {text!r}: port {port_text!r}: expected {lowest} to 65535")
    return Url(kind, host, port)


def _serial(text: str) -> Url:
    device, _, baud_text = text.partition(",")
    baud_text = baud_text or "57600"
    if not (baud_text.isascii() and baud_text.isdigit() and int(baud_text) > 0):
        raise BadInputError(f"connection URL {text!r}: baud {baud_text!r}: expected a number such as 57600")
    return Url("serial", device, int(baud_text))
