"""Which store a process works on: an id that lies in it, for one store has many URLs.

Effects: reads the store, and puts the id there once.
"""

from __future__ import annotations

import secrets
from typing import Final

from pbrs_farm.core.errors import ObjectMissing
from pbrs_farm.store import Store

KEY: Final = "jobs/store.id"


def known_store_id(store: Store) -> str:
    """The id that lies in the store, "" where none does.

    Only reads, so it suits a client that may not write. At most 64 characters, whatever lies there.
    Other StoreFailed are passed on.
    """
    try:
        return store.get(KEY).decode("ascii", "replace").strip()[:64]
    except ObjectMissing:
        return ""


def store_id(store: Store) -> str:
    """The store's id; put there now where it has none.

    16 hex digits, random. Of several processes that ask a new store at once one writes, and all
    read that answer. Two URLs with one id are one store.
    """
    if not (known := known_store_id(store)):
        store.put_if_absent(KEY, secrets.token_hex(8).encode())
        known = known_store_id(store)
    return known
