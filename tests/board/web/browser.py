"""Start options of the browser: software drawing, so that it needs no GPU and gives the same bits."""

from __future__ import annotations

import time
from typing import Any, Final

ARGUMENTS: Final = (
    "--no-sandbox",  # tests run as root in containers
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


def until(tab: Any, expression: str, timeout: float = 15_000) -> None:
    """Wait until an expression of the page is true; Playwright's wait uses eval, which the board forbids."""
    end = time.monotonic() + timeout / 1000
    while not tab.evaluate(expression):
        assert time.monotonic() < end, f"not within {timeout / 1000:.0f} s: {expression}"
        time.sleep(0.05)
