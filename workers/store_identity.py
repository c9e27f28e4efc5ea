"""Identity of a store: an id inside it, since one store has many URLs.

Effects: reads the store, and writes the id there once.
"""

from __future__ import annotations

import secrets
from typing import Final

from pbrs_farm.core.errors import ObjectMissing
from pbrs_farm.store import Store

KEY: Final = "jobs/store.id"


def known_store_id(store: Store) -> str:
    """The store's id, "" if it does not exist yet.

    Only reads, so it suits a client without write access. At most 64 characters. Other StoreFailed are passed
    on.
    """
    try:
        return store.get(KEY).decode("ascii", "replace").strip()[:64]
    except ObjectMissing:
        return ""


def store_id(store: Store) -> str:
    """The store's id, created on first use.

    16 random hex digits. Of several processes with a new store one writes, and all read that id. Two URLs with
    one id are one store.
    """
    if not (identity := known_store_id(store)):
        store.put_if_absent(KEY, secrets.token_hex(8).encode())
        identity = known_store_id(store)
    return identity
