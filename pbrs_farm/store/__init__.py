"""Object storage: memory, folder and S3 behind one small interface; effects: files and network."""

from pbrs_farm.store.memory_store import MemoryStore
from pbrs_farm.store.object_store import Head, Store
from pbrs_farm.store.secret import Secret
from pbrs_farm.store.url import StoreSettings, store_from_url

__all__ = ["Head", "MemoryStore", "Secret", "Store", "StoreSettings", "store_from_url"]
