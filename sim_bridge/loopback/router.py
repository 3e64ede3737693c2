"""Which peers a packet is passed on to, by ArduPilot's rules.

https://ardupilot.org/dev/docs/mavlink-routing-in-ardupilot.html

Pure. A peer is passed something only after it has sent something; never what it sent itself; nothing twice. A
packet that claims to come from the vehicle itself is an impostor's, and is neither heeded nor passed on.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

# they speak of one radio link; and a key is for nobody but its target
_NEVER_FORWARDED = frozenset({"RADIO", "RADIO_STATUS", "SETUP_SIGNING"})

Peer = Hashable


class Router:
    """Learns who is behind which peer, and routes for the vehicle (system, component)."""

    def __init__(self, system: int, component: int) -> None:
        self._own = (system, component)
        self._routes: dict[tuple[int, int], set[Peer]] = {}

    def route(self, peer: Peer, message: Any) -> tuple[bool, tuple[Peer, ...]]:
        """For a packet from `peer`: is it (also) for the vehicle, and to which peers is it passed on."""
        source = (message.get_srcSystem(), message.get_srcComponent())
        if source == self._own:
            return False, ()
        if source[0] != 0:
            self._routes.setdefault(source, set()).add(peer)
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        for_us = system in (0, self._own[0]) and component in (0, self._own[1])
        if message.get_type() in _NEVER_FORWARDED or (for_us and system != 0 and component != 0):
            return for_us, ()
        return for_us, self._others(peer, system, component)

    def forget(self, peer: Peer) -> None:
        """The peer is gone."""
        for peers in self._routes.values():
            peers.discard(peer)

    def _others(self, peer: Peer, system: int, component: int) -> tuple[Peer, ...]:
        chosen: dict[Peer, None] = {}
        for (known_system, known_component), peers in self._routes.items():
            # another system's components may sit behind any of its links (as ArduPilot has it)
            inside = component in (0, known_component) or system != self._own[0]
            if system == 0 or (system == known_system and inside):
                chosen.update(dict.fromkeys(p for p in peers if p != peer))
        return tuple(chosen)
