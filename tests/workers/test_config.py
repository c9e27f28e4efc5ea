from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from workers.config import FarmConfig, Limits


def test_every_setting_stands_in_the_docs() -> None:
    docs = (Path(__file__).parents[2] / "docs/farm.md").read_text()
    elsewhere = {"redis_url", "store_url", "store", "limits", "webhook"}
    names = {f"_{f.name.upper()}" for f in fields(FarmConfig) if f.name not in elsewhere}
    names |= {f"_{f.name.upper()}" for f in fields(Limits)}
    assert sorted(n for n in names if f"{n}`" not in docs) == []
