"""The index of an output root: an SQLite file of houses and views. Effects: writes that file.

It is a cache: a damaged or older file is deleted and rebuilt. One writer and many readers; each thread
has its own connection.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pbrs_farm.board.index.house_rows import HouseRow
from pbrs_farm.core.lighting import ALL_MODES

_VERSION: Final = 5  # of the tables below and of covers
LAYERS_PER_COLUMN: Final = 62  # bits: an integer of SQLite has 64
_SCHEMA: Final = f"""
PRAGMA journal_mode = WAL;
CREATE TABLE IF NOT EXISTS house (
    id TEXT PRIMARY KEY, name TEXT NOT NULL, credit TEXT NOT NULL, n_rooms INTEGER NOT NULL,
    n_views INTEGER NOT NULL, n_warned INTEGER NOT NULL, cover TEXT NOT NULL,
    fingerprint TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS view (
    house TEXT NOT NULL, id TEXT NOT NULL, room TEXT NOT NULL, layers INTEGER NOT NULL,
    more_layers INTEGER NOT NULL, classes INTEGER NOT NULL, warnings TEXT NOT NULL, reason TEXT,
    n_objects INTEGER NOT NULL, lux REAL, items TEXT NOT NULL,
    PRIMARY KEY (house, id)
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS view_of_room ON view (room, house, id);
CREATE INDEX IF NOT EXISTS view_of_reason ON view (reason, house, id);
CREATE TABLE IF NOT EXISTS fact (name TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID;
PRAGMA user_version = {_VERSION};
"""


class ViewIndex:
    """Houses and views of one output root."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._local = threading.local()  # a connection per thread
        self._writing = threading.Lock()
        self._generation = 0
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._prepare()
        except sqlite3.DatabaseError:
            # Rebuild a damaged file.
            for path in file.parent.glob(f"{file.name}*"):
                path.unlink()
            self._local = threading.local()
            self._prepare()

    @property
    def generation(self) -> int:
        """Number of changes, for caches of answers."""
        return self._generation

    def rows(self, sql: str, values: Sequence[Any] = ()) -> list[sqlite3.Row]:
        """Rows of a SELECT with bound values."""
        return self._connection().execute(sql, values).fetchall()

    def fingerprints(self) -> dict[str, str]:
        """Fingerprint of each house."""
        return {r["id"]: r["fingerprint"] for r in self.rows("SELECT id, fingerprint FROM house")}

    def fact(self, name: str) -> str:
        """A named text, or ""."""
        rows = self.rows("SELECT text FROM fact WHERE name = ?", (name,))
        return str(rows[0]["text"]) if rows else ""

    def enter(self, houses: Iterable[tuple[HouseRow, str]]) -> None:
        """Add or replace houses with their fingerprints in one transaction."""
        with self._writing, self._connection() as connection:
            for house, fingerprint in houses:
                _enter_house(connection, house, fingerprint)
        self._generation += 1

    def remove(self, houses: Iterable[str]) -> None:
        """Remove houses."""
        with self._writing, self._connection() as connection:
            for house in houses:
                connection.execute("DELETE FROM view WHERE house = ?", (house,))
                connection.execute("DELETE FROM house WHERE id = ?", (house,))
        self._generation += 1

    def set_verdicts(self, reasons: Mapping[tuple[str, str], str], fingerprint: str) -> None:
        """Replace the verdicts of the views: "" for kept, else a reason."""
        with self._writing, self._connection() as connection:
            connection.execute("UPDATE view SET reason = NULL WHERE reason IS NOT NULL")
            connection.executemany(
                "UPDATE view SET reason = ? WHERE house = ? AND id = ?",
                ((reason, house, view) for (house, view), reason in reasons.items()),
            )
            connection.execute("REPLACE INTO fact VALUES ('selection', ?)", (fingerprint,))
        self._generation += 1

    def _prepare(self) -> None:
        connection = self._connection()
        if connection.execute("PRAGMA user_version").fetchone()[0] not in (0, _VERSION):
            raise sqlite3.DatabaseError("another version")
        connection.executescript(_SCHEMA)

    def _connection(self) -> sqlite3.Connection:
        connection: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if connection is None:
            connection = sqlite3.connect(self._file, timeout=30.0)
            connection.row_factory = sqlite3.Row
            # A lost cache is rebuilt, so do not wait for the disk.
            connection.execute("PRAGMA synchronous = OFF")
            connection.execute("PRAGMA cache_size = -8000")
            self._local.connection = connection
        return connection


def _enter_house(connection: sqlite3.Connection, house: HouseRow, fingerprint: str) -> None:
    # Keep the verdicts, which change separately.
    reasons = dict(
        connection.execute(
            "SELECT id, reason FROM view WHERE house = ? AND reason IS NOT NULL", (house.id,)
        ).fetchall()
    )
    connection.execute("DELETE FROM view WHERE house = ?", (house.id,))
    connection.executemany(
        "INSERT INTO view VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (
            (
                house.id,
                v.id,
                v.room,
                v.layers & (1 << LAYERS_PER_COLUMN) - 1,
                v.layers >> LAYERS_PER_COLUMN,
                v.classes,
                json.dumps(v.warnings),
                reasons.get(v.id),
                v.n_objects,
                v.lux,
                json.dumps(v.items),
            )
            for v in house.views
        ),
    )
    n_warned = sum(bool(view.warnings) for view in house.views)
    row = (
        house.id,
        house.name,
        house.credit,
        house.n_rooms,
        len(house.views),
        n_warned,
        _cover(house),
        fingerprint,
    )
    connection.execute("REPLACE INTO house VALUES (?, ?, ?, ?, ?, ?, ?, ?)", row)


def _cover(house: HouseRow) -> str:
    """The view on the house's card: most lighting modes, no warning, best score of the camera."""
    modes = (1 << len(ALL_MODES)) - 1  # modes are the first layers
    ranked = sorted(
        house.views,
        key=lambda v: (-(v.layers & modes).bit_count(), bool(v.warnings), -v.score, v.id),
    )
    return ranked[0].id if ranked else ""
