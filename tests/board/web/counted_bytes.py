"""Bytes that a page loads over the network."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def loaded_kb(tab: Any) -> Iterator[Callable[[], float]]:
    """Counts the bytes that the tab loads; a call returns kilobytes so far."""
    session = tab.context.new_cdp_session(tab)
    session.send("Network.enable")
    sizes: list[float] = []
    session.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    yield lambda: sum(sizes) / 1000
    session.detach()
