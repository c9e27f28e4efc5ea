"""How a board is served, and where it keeps what it makes; frozen values, no effects."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pbrs_farm.store.secret import Secret

DEFAULT_PORT: Final = 8080


@dataclass(frozen=True, slots=True)
class BoardLimits:
    """What one client may ask of the board."""

    requests_per_s: float = 100.0  # on average, of one address
    burst: float = 600.0  # requests at once, of one address
    logins_per_s: float = 0.1
    login_burst: float = 5.0
    connections: int = 512  # at once; this machine's own come on top
    connections_per_address: int = 128
    receive_s: float = 10.0  # until a request's header is whole, and its form
    body_bytes: int = 16_384  # of a form
    target_bytes: int = 4_096  # of a path with its query
    streams: int = 64  # pages that listen for changes
    file_bytes: int = 1_000_000_000  # of a stored file that is handed out


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """How a board is served."""

    cache: Path  # index, thumbnails, light layers, audit.log
    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    token: Secret = field(default_factory=Secret)  # who shows it may change things
    is_readonly: bool = False  # read-only: no one can change anything
    allowed_hosts: tuple[str, ...] = ()  # names a browser may call the board by
    price_per_slot_hour: float = 0.0  # of the farm; 0 = no cost is shown
    currency: str = "EUR"
    limits: BoardLimits = field(default_factory=BoardLimits)

    @property
    def is_private(self) -> bool:
        """Only this machine reaches the board, and reading needs no token."""
        return is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """Whether a host's name or address means this machine.

    "localhost", 127.0.0.0/8 and ::1, in brackets too. Other names are not looked up and count as
    public, 0.0.0.0 as well.
    """
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
