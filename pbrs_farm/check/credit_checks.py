"""ATTRIBUTION.txt against what the dressed homes of a root owe. Effects: reads files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys


def check_credits(root: Path, houses: list[StoredHouse], tally: Tally) -> None:
    """ATTRIBUTION.txt names each work that a dress.json of the root says must be credited.

    With the licence that is told there; a root whose homes owe nothing needs no such file.
    """
    lines: dict[str, str] = {}
    owed = [h.house.get("source", {}).get("attribution", "") for h in houses]
    for house in houses:
        for credit in _credits(house):
            by = f", by {credit['creator']}" if credit.get("creator") else ""
            lines[f"- {credit['name']}{by}"] = credit.get("licence") or "no licence named"
    file = root / keys.ATTRIBUTION
    if not any(_is_owed(licence) for licence in lines.values()):
        return
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    except OSError:
        text = ""
    what = "is missing, and works must be credited"
    if not tally.expect("credits", keys.ATTRIBUTION, bool(text), what):
        return
    stored = text.splitlines()
    for begin, licence in lines.items():
        same = any(line.startswith(begin) and line.endswith(licence) for line in stored)
        tally.expect("credits", keys.ATTRIBUTION, same, f"does not name {begin[2:]}: {licence}")
    for line in filter(None, owed):
        tally.expect("credits", keys.ATTRIBUTION, line in text, f"does not carry: {line}")


def _is_owed(licence: str) -> bool:
    """Whether it asks for a credit: all but what is in the public domain, or has none."""
    return not licence.upper().startswith(("CC0", "PUBLIC", "NO LICENCE"))


def _credits(house: StoredHouse) -> list[dict[str, Any]]:
    found = house.dress.get("credits", [])
    return [c for c in found if isinstance(c, dict) and "name" in c]
