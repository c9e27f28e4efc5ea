"""A job's priority: a number from 0, which goes first, to 9; pure."""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.errors import BadInput

DEFAULT_PRIORITY: Final = 5
LEAST_URGENT: Final = 9


def priority_from_text(text: str) -> int:
    """The priority a word names. Raises BadInput for what is no number from 0 to 9."""
    if len(text) != 1 or not text.isascii() or not text.isdigit():
        hint = f"a number from 0, which goes first, to {LEAST_URGENT}"
        raise BadInput(repr(text[:40]), "", "not a priority", hint=hint)
    return int(text)
