"""ATTRIBUTION.txt of an output root: whose models and pictures its dressed homes show; effects: the store's.

It is derived from the manifest and each dressed house's dress.json, so that any process may write
it: who writes looks again afterwards, and writes anew where a house has come in meanwhile.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pbrs_farm.core import keys
from pbrs_farm.core.errors import ObjectMissing
from pbrs_farm.core.house import House
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown
from pbrs_farm.dress.report import Credit, DressReport, is_owed
from pbrs_farm.store.object_store import Store, get_or_none

_ROUNDS = 5  # of looking again; more houses than that do not come in while a text is written


def write_attribution(store: Store) -> None:
    """Write ATTRIBUTION.txt if anything needs credit; looks again until no other worker's house is new."""
    last_rows: list[dict[str, str]] | None = None
    for _round in range(_ROUNDS):
        rows = dressing_rows(get_or_none(store, keys.MANIFEST) or b"")
        if rows == last_rows:
            return
        last_rows = rows
        write_attribution_of(store, rows)


def write_attribution_of(store: Store, rows: Sequence[dict[str, str]]) -> None:
    """Write ATTRIBUTION.txt of these dressing_rows, unless it is equal or nothing needs credit."""
    homes = (row.get("attribution", "") for row in rows)
    text = attribution_text(homes, _credits(store, (row["key"] for row in rows)))
    if not text:
        return
    data = text.encode("utf-8", "replace")
    if get_or_none(store, keys.ATTRIBUTION) != data:
        store.put(keys.ATTRIBUTION, data)


def attribution_text(homes: Iterable[str], credits: Iterable[Credit]) -> str:
    """The file's text; "" if nothing asks for a credit. homes: the credit lines of the homes themselves."""
    # Write a line a work, apart by whether its licence asks for one.
    lines: dict[bool, set[str]] = {True: set(), False: set()}
    for credit in credits:
        by = f", by {credit.creator}" if credit.creator else ""
        of = f" ({credit.library})" if credit.library else ""
        line = f"- {credit.name}{by}{of}: {credit.licence or 'no licence named'}"
        lines[is_owed(credit)].add(shown(line, MAX_MESSAGE))
    if not lines[True]:
        return ""
    parts = [
        "The pictures of this folder show works of others, placed, scaled and recoloured.",
        *_paragraph("Homes:", {f"- {shown(line, MAX_MESSAGE)}" for line in homes if line}),
        *_paragraph("Models and surface pictures that must be credited:", lines[True]),
        *_paragraph("Models and surface pictures free of conditions:", lines[False]),
    ]
    return "\n".join(parts) + "\n"


def licences_of_view(
    store: Store, house: House, instances: Iterable[Mapping[str, Any]]
) -> dict[str, list[str]]:
    """Licence -> ids of the library's models and pictures on the items of these rows of view.json, and of the home.

    All pictures of an item count, on its hidden sides too. The home counts, by its file, if one of its
    items is visible. Generated items, and homes and models without a named licence, are not listed.
    """
    from pbrs_farm.dress.gates.bodies import piece_id  # here: scipy, which other processes spare

    items = [house.items[int(row["id"]) - 1] for row in instances]
    shown = {piece_id(item) for item in items}
    materials = {s.material for item in items for s in item.surfaces}
    shown |= {house.materials[m].texture_id or "" for m in materials}
    licences: dict[str, set[str]] = {}
    for credit in _credits(store, [keys.house_key(house.id, keys.DRESS)]):
        if credit.id in shown:
            licences.setdefault(credit.licence, set()).add(credit.id)
    if any(not piece_id(item) for item in items):
        licences.setdefault(house.source.licence, set()).add(house.source.file)
    licences.pop("", None)
    return {licence: sorted(ids) for licence, ids in sorted(licences.items())}


def _paragraph(title: str, lines: set[str]) -> list[str]:
    return ["", title, *sorted(lines)] if lines else []


def dressing_rows(manifest: bytes) -> list[dict[str, str]]:
    """The rows of every dress.json in a manifest; other lines, perhaps millions, are not parsed."""
    lines = re.finditer(rb"^.*/" + re.escape(keys.DRESS).encode() + rb".*$", manifest, re.MULTILINE)
    return [json.loads(match[0]) for match in lines]


def _credits(store: Store, dressed: Iterable[str]) -> list[Credit]:
    credits: list[Credit] = []
    for key in dressed:
        try:
            credits += DressReport.model_validate_json(store.get(key)).credits
        except (ObjectMissing, ValueError):
            continue  # made anew at this moment, or by another version: it comes with its own run
    return credits
