"""ATTRIBUTION.txt against the credits that the homes of a root require. Effects: reads files."""

from __future__ import annotations

from typing import Any

from pbrs_farm.check.cases import RootCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys


def check_credits(case: RootCase) -> None:
    """ATTRIBUTION.txt names each work of a dress.json that requires a credit, with its licence.

    A root whose homes require none needs no such file.
    """
    lines: dict[str, str] = {}
    houses = [StoredHouse(folder) for folder in case.houses]
    for house in houses:
        for credit in _credits(house):
            by = f", by {credit['creator']}" if credit.get("creator") else ""
            lines[f"- {credit['name']}{by}"] = credit.get("licence") or "no licence named"
    file = case.root / keys.ATTRIBUTION
    if not any(_requires_credit(licence) for licence in lines.values()):
        return
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    except OSError:
        text = ""
    expect = case.tally.at("credits", keys.ATTRIBUTION)
    if not expect(bool(text), "is missing, and works must be credited"):
        return
    stored = text.splitlines()
    for begin, licence in lines.items():
        is_named = any(line.startswith(begin) and line.endswith(licence) for line in stored)
        expect(is_named, f"does not name {begin[2:]}: {licence}")
    for house in houses:
        line = house.house.get("source", {}).get("attribution", "")
        if line:
            expect(line in text, f"does not carry: {line}")


def _requires_credit(licence: str) -> bool:
    """False for the public domain and for works without a licence."""
    return not licence.upper().startswith(("CC0", "PUBLIC", "NO LICENCE"))


def _credits(house: StoredHouse) -> list[dict[str, Any]]:
    rows = house.dress.get("credits", [])
    return [row for row in rows if isinstance(row, dict) and "name" in row]


CHECKS = (Check(name="credits", of="root", function=check_credits, cost=2),)
