"""Opening the sockets and serial ports behind connection URLs; each failure is one LinkError line."""

from __future__ import annotations

import contextlib
import errno
import os
import socket

from dslam_mav.errors import LinkError
from dslam_mav.mav.url import Url

_RECEIVE_BUFFER_BYTES = 16 << 20
_CONNECT_TIMEOUT_S = 5.0


def listening_socket(url: Url) -> socket.socket:
    """A bound UDP socket (`udpin`) or a listening TCP one (`tcpin`)."""
    stream = url.kind == "tcpin"
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
    try:
        if stream:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        else:
            enlarge_receive_buffer(sock)
        sock.bind((url.host, url.port))
        if stream:
            sock.listen()
    except (OSError, UnicodeError) as problem:
        sock.close()
        raise LinkError(f"{url}: {_reason(problem, url)}") from None
    return sock


def connected_socket(url: Url) -> socket.socket:
    """A connected socket: UDP (`udpout`, nothing is sent yet) or TCP (`tcp`)."""
    stream = url.kind == "tcp"
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
    try:
        enlarge_receive_buffer(sock)
        sock.settimeout(_CONNECT_TIMEOUT_S)
        sock.connect((url.host, url.port))
        if stream:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.settimeout(None)
    except (OSError, UnicodeError) as problem:
        sock.close()
        raise LinkError(f"{url}: {_reason(problem, url)}") from None
    return sock


def serial_descriptor(url: Url) -> int:
    """A raw 8N1 serial port as a file descriptor."""
    try:
        import termios
        import tty
    except ImportError:
        raise LinkError(f"{url}: serial ports need a POSIX system; connect over UDP or TCP") from None
    speed = getattr(termios, f"B{url.port}", None)
    if speed is None:
        raise LinkError(f"{url}: baud {url.port} is not one this system offers, such as 57600 or 115200")
    descriptor = -1
    try:
        descriptor = os.open(url.host, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(descriptor)
        attributes = termios.tcgetattr(descriptor)
        attributes[2] |= termios.CLOCAL | termios.CREAD
        attributes[4] = attributes[5] = speed
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
    except (OSError, termios.error) as problem:
        if descriptor >= 0:
            os.close(descriptor)
        raise LinkError(f"{url}: {_reason(problem, url)}") from None
    return descriptor


def enlarge_receive_buffer(sock: socket.socket) -> None:
    """Room for some thousand packets; beyond the system's limit where we may (root), up to it otherwise."""
    force = getattr(socket, "SO_RCVBUFFORCE", 33 if os.uname().sysname == "Linux" else None)
    if force is not None:
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, force, _RECEIVE_BUFFER_BYTES)
            return
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)


def _reason(problem: Exception, url: Url) -> str:
    if isinstance(problem, (socket.gaierror, UnicodeError)):
        return f"host {url.host!r} is unknown"
    if isinstance(problem, TimeoutError):
        return f"no answer within {_CONNECT_TIMEOUT_S:g} s"
    number = getattr(problem, "errno", None)
    if number == errno.EADDRINUSE:
        return f"port {url.port} is in use"
    if number == errno.EADDRNOTAVAIL:
        return f"host {url.host!r} is not an address of this machine"
    if number == errno.ECONNREFUSED:
        return "connection refused: nothing listens there"
    return os.strerror(number).lower() if isinstance(number, int) else str(problem)
