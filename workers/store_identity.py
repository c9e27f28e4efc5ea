"""Identity of a store, which may have many URLs: an id inside it, written once."""

from __future__ import annotations

import secrets
from typing import Final

from pbrs_farm.core.errors import ObjectMissing
from pbrs_farm.store import Store

KEY: Final = "jobs/store.id"


def known_store_id(store: Store) -> str:
    """The store's id, "" if it does not exist yet; only reads, for clients without write access."""
    try:
        return store.get(KEY).decode("ascii", "replace").strip()[:64]
    except ObjectMissing:
        return ""


def store_id(store: Store) -> str:
    """The store's id, 16 random hex digits, made on first use; of several processes one writes it."""
    if not (identity := known_store_id(store)):
        store.put_if_absent(KEY, secrets.token_hex(8).encode())
        identity = known_store_id(store)
    return identity
