"""Views with histograms in a store, for selection."""

from __future__ import annotations

import json

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.store import MemoryStore
from tests.selection.histogram_sets import record


def put_house(store: MemoryStore, house: str, n_views: int, seed: int = 1, *, manifest=True):
    rng = np.random.default_rng([seed, *house.encode()])
    lines = []
    for k in range(n_views):
        view = f"0_{k // 2}_{k % 2}"
        data = record(house, view, rng).json_bytes()
        key = keys.view_key(house, view, "histogram.json")
        store.put(key, data)
        store.put(keys.view_key(house, view, "view.json"), b"{}")
        store.put(keys.view_key(house, view, "mlt_il_ol.png"), b"no picture is opened")
        lines.append(json.dumps({"key": key, "sha256": keys.sha256(data)}))
    if manifest:
        store.put(keys.house_key(house, "manifest.jsonl"), "\n".join(lines).encode())
