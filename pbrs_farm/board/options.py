"""Options and limits of a board."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pbrs_farm.store.secret import Secret

DEFAULT_PORT: Final = 8080


@dataclass(frozen=True, slots=True)
class BoardLimits:
    """Limits of clients."""

    requests_per_s: float = 100.0  # mean of one address
    burst: float = 600.0  # maximum burst of one address
    logins_per_s: float = 0.1
    login_burst: float = 5.0
    connections: int = 512  # without those of this machine
    connections_per_address: int = 128
    receive_s: float = 10.0  # for the header of a request, and for its form
    body_bytes: int = 16_384  # of a form
    target_bytes: int = 4_096  # of a path with its query
    streams: int = 64  # pages with live updates
    file_bytes: int = 1_000_000_000  # of a download


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """Options of a board."""

    cache: Path  # index, thumbnails, light layers, audit.log
    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    token: Secret = field(default_factory=Secret)  # required for changes
    is_readonly: bool = False  # no changes at all
    allowed_hosts: tuple[str, ...] = ()  # valid host names
    price_per_slot_hour: float = 0.0  # of the farm; 0 = unknown
    currency: str = "EUR"
    limits: BoardLimits = field(default_factory=BoardLimits)

    @property
    def is_private(self) -> bool:
        """True if only this machine reaches the board; then reading needs no token."""
        return is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """True for "localhost", 127.0.0.0/8 and ::1, in brackets too; other names are not resolved."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
