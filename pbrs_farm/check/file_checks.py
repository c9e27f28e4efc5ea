"""Manifest, markers, files and credits: complete, unchanged and listed. Effects: reads files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pbrs_farm.check.cases import RootCase
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.checks import Check
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import (
    BadFile,
    object_from_json,
    stored_bytes,
    stored_digest,
    stored_object,
)
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys


def unfinished_houses(root: Path, houses: Sequence[Path]) -> dict[str, str]:
    """House that a run still renders (it has no manifest yet) -> "house: 3 of 12 views are finished"."""
    try:
        listed = stored_bytes(root / "manifest.jsonl")
    except BadFile:
        listed = b""
    unfinished = {}
    for house in houses:
        if (
            house / "manifest.jsonl"
        ).is_file() or f'"{house.parent.name}/{house.name}/'.encode() in listed:
            continue
        n = len(list(house.glob("views/*/view.json")))
        try:
            planned = f" of {len(stored_object(house / 'cameras.json')['views'])}"
        except (BadFile, KeyError, TypeError):
            planned = ""
        unfinished[house.name] = f"{house.name}: {n}{planned} views are finished"
    return unfinished


def check_files(case: RootCase) -> None:
    """Compare a house's manifest.jsonl with the done markers and with every file below views/."""
    root, (house,), tally = case.root, case.houses, case.tally
    if unfinished_houses(root, (house,)):
        return
    rows = _manifest(house / "manifest.jsonl", house.name, tally)
    credit = _credit(house)
    for key, row in rows.items():
        _check_row(root, key, row, tally)
        if credit is not None:
            judge("manifest credit", key, tally, row={"attribution": "", **row}, credit=credit)
    _check_markers(house, rows, tally)
    listed = {root / key for key in rows}
    for file in sorted(p for p in (house / "views").rglob("*") if p.is_file()):
        place = str(file.relative_to(root))
        tally.expect("files", place, file in listed, "is not in manifest.jsonl")


def _credit(house: Path) -> str | None:
    """The credit line of a house; None if house.json lacks it."""
    try:
        return str(stored_object(house / "house.json")["source"]["attribution"])
    except (BadFile, KeyError, TypeError):
        return None


def check_root_manifest(case: RootCase) -> None:
    """The root's manifest.jsonl is the houses' manifests in their order."""
    expect = case.tally.at("files", "manifest.jsonl")
    files = [house / "manifest.jsonl" for house in case.houses]
    is_finished = case.has("manifest.jsonl") or not unfinished_houses(case.root, case.houses)
    if not is_finished:
        return  # written at the end of the run
    try:
        parts = [stored_bytes(f) for f in files if f.is_file()]
        same = stored_bytes(case.root / "manifest.jsonl") == b"".join(parts)
    except BadFile as error:
        expect(False, str(error))
        return
    expect(same, "differs from the houses'")


def _manifest(file: Path, house: str, tally: Tally) -> dict[str, dict[str, Any]]:
    if not tally.expect("files", house, file.is_file(), "has no manifest.jsonl"):
        return {}
    rows: dict[str, dict[str, Any]] = {}
    try:
        lines = stored_bytes(file).splitlines()
    except BadFile as error:
        tally.expect("files", f"{house}/manifest.jsonl", False, str(error))
        return {}
    for number, line in enumerate(lines, start=1):
        try:
            row = object_from_json(line)
            key = str(row["key"])
            # A key must not lead out of the root.
            if not {"bytes", "sha256"} <= row.keys() or ".." in key.split("/") or key[:1] == "/":
                raise ValueError
        except (ValueError, KeyError, TypeError):
            tally.expect("files", f"{house}/manifest.jsonl line {number}", False, "is not a row")
            continue
        tally.expect("files", key, key not in rows, "is listed twice")
        rows[key] = row
    return rows


def _check_row(root: Path, key: str, row: dict[str, Any], tally: Tally) -> None:
    file = root / key
    if not tally.expect("files", key, file.is_file(), "is missing"):
        return
    try:
        disk = {"sha256": stored_digest(file), "bytes": file.stat().st_size}
    except BadFile as error:
        tally.expect("files", key, False, str(error))
        return
    judge("manifest row", key, tally, row=row, disk=disk)


def _check_markers(house: Path, rows: dict[str, dict[str, Any]], tally: Tally) -> None:
    for file in sorted(house.glob("done/*.json")):
        place = f"{house.name}/done/{file.name}"
        try:
            marker = stored_object(file)
            stored = [(str(s["key"]), s["sha256"], s["n_bytes"]) for s in marker["files"]]
            marker = {"view_id": None, **marker}
            _ = marker["step"], marker["house_id"], marker["digest"]
        except (ValueError, KeyError, TypeError):
            tally.expect("markers", place, False, "is not a marker")
            continue
        step, _, view = file.stem.partition(".")
        name = {"step": step, "house": house.name, "view": view or None}
        judge("marker", place, tally, marker=marker, name=name)
        for key, sha256, n_bytes in stored:
            entry = {"key": key, "sha256": sha256, "n_bytes": n_bytes}
            judge("marker file", place, tally, row=rows.get(key, {}), entry=entry, marker=marker, name=name)  # fmt: skip


def check_credits(case: RootCase) -> None:
    """ATTRIBUTION.txt names each work of a dress.json that requires a credit, with its licence."""
    lines: dict[str, str] = {}
    houses = [StoredHouse(folder) for folder in case.houses]
    for house in houses:
        for credit in _credits(house):
            by = f", by {credit['creator']}" if credit.get("creator") else ""
            lines[f"- {credit['name']}{by}"] = credit.get("licence") or "without licence"
    file = case.root / keys.ATTRIBUTION
    if not any(_requires_credit(licence) for licence in lines.values()):
        return
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    except OSError:
        text = ""
    expect = case.tally.at("credits", keys.ATTRIBUTION)
    if not expect(bool(text), "is missing, but works must be credited"):
        return
    stored = text.splitlines()
    for begin, licence in lines.items():
        is_named = any(line.startswith(begin) and line.endswith(licence) for line in stored)
        expect(is_named, f"does not name {begin[2:]}: {licence}")
    for house in houses:
        line = house.house.get("source", {}).get("attribution", "")
        if line:
            expect(line in text, f"lacks: {line}")


def _requires_credit(licence: str) -> bool:
    """False for the public domain and for works without a licence."""
    return not licence.upper().startswith(("CC0", "PUBLIC", "NO LICENCE"))


def _credits(house: StoredHouse) -> list[dict[str, Any]]:
    rows = house.dress.get("credits", [])
    return [row for row in rows if isinstance(row, dict) and "name" in row]


CHECKS = (
    Check("files", "root", check_root_manifest, 1, ("manifest.jsonl",)),
    Check("credits", "root", check_credits, 2),
    Check("files", "files", check_files, 1),
)
