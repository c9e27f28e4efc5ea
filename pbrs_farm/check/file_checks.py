"""Manifest, markers and files of a house: nothing missing, nothing changed, nothing unlisted. Effects: reads files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_files import (
    BadFile,
    object_from_json,
    stored_bytes,
    stored_digest,
    stored_object,
)


def check_files(root: Path, house: Path, tally: Tally) -> None:
    """Compare manifest.jsonl of house with the files on disk and with the done markers.

    A file below views that no row lists fails as well.
    """
    # Each listed file is there, with the bytes and the hash that are listed.
    rows = _manifest(house / "manifest.jsonl", house.name, tally)
    credit = _credit(house)
    for key, row in rows.items():
        _check_row(root, key, row, tally)
        if credit is not None:
            same = row.get("attribution", "") == credit
            tally.expect("credits", key, same, "its line of manifest.jsonl carries another credit")
    _check_markers(house, rows, tally)
    # Find files that nothing lists.
    listed = {root / key for key in rows}
    for file in sorted(p for p in (house / "views").rglob("*") if p.is_file()):
        place = str(file.relative_to(root))
        tally.expect("files", place, file in listed, "is not in manifest.jsonl")


def _credit(house: Path) -> str | None:
    """The line that what is made from a house must carry; None where house.json does not say."""
    try:
        return str(stored_object(house / "house.json")["source"]["attribution"])
    except (BadFile, KeyError, TypeError):
        return None


def check_root_manifest(root: Path, houses: list[Path], tally: Tally) -> None:
    """The root's manifest.jsonl is the houses' manifests one after another, if there is one.

    Nothing is counted where the root has no manifest. houses must be in the order in which it was
    merged.
    """
    merged = root / "manifest.jsonl"
    if not merged.is_file():
        return
    files = [h / "manifest.jsonl" for h in houses]
    try:
        parts = [stored_bytes(f) for f in files if f.is_file()]
        same = stored_bytes(merged) == b"".join(parts)
    except BadFile as error:
        tally.expect("files", "manifest.jsonl", False, str(error))
        return
    tally.expect("files", "manifest.jsonl", same, "differs from the houses'")


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
            # A key that leads out of the root is no row either.
            if not {"bytes", "sha256"} <= row.keys() or ".." in key.split("/") or key[:1] == "/":
                raise ValueError
        except (ValueError, KeyError, TypeError):
            tally.expect("files", f"{house}/manifest.jsonl line {number}", False, "is no row")
            continue
        tally.expect("files", key, key not in rows, "is listed twice")
        rows[key] = row
    return rows


def _check_row(root: Path, key: str, row: dict[str, Any], tally: Tally) -> None:
    file = root / key
    if not tally.expect("files", key, file.is_file(), "is missing"):
        return
    try:
        digest = stored_digest(file)
    except BadFile as error:
        tally.expect("files", key, False, str(error))
        return
    n_bytes = file.stat().st_size
    tally.expect("files", key, n_bytes == row["bytes"], f"{n_bytes} bytes, not {row['bytes']}")
    tally.expect("hashes", key, digest == row["sha256"], "content differs from its sha256")


def _check_markers(house: Path, rows: dict[str, dict[str, Any]], tally: Tally) -> None:
    for file in sorted(house.glob("done/*.json")):
        place = f"{house.name}/done/{file.name}"
        try:
            marker = stored_object(file)
            stored = marker["files"]
            pairs = [(str(s["key"]), s["sha256"], s["n_bytes"]) for s in stored]
            told = (marker["step"], marker["house_id"], marker.get("view_id"))
            digest = marker["digest"]
        except (ValueError, KeyError, TypeError):
            tally.expect("markers", place, False, "is no marker")
            continue
        # Its name says what it is of.
        step, _, view = file.stem.partition(".")
        same = told == (step, house.name, view or None)
        tally.expect("markers", place, same, "is told to be of another step, house or view")
        # A marker and the manifest tell the same of each file.
        for key, sha256, n_bytes in pairs:
            row = rows.get(key, {})
            same = row.get("sha256") == sha256 and row.get("bytes") == n_bytes
            tally.expect("markers", place, same, f"{key} is not as in manifest.jsonl")
            same = (row.get("step"), row.get("digest")) == (step, digest)
            tally.expect("markers", place, same, f"{key} is of another step in manifest.jsonl")
