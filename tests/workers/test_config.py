from __future__ import annotations

import tempfile
from dataclasses import fields, replace
from pathlib import Path

import pytest

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.store.secret import Secret
from workers.config import FarmConfig, Limits, config_from_environment, make_scratch


def test_every_setting_is_in_the_docs() -> None:
    docs = (Path(__file__).parents[2] / "docs/farm/settings.md").read_text()
    elsewhere = {"redis_url", "store_url", "store", "limits", "webhook", "token"}
    names = {f"_{f.name.upper()}" for f in fields(FarmConfig) if f.name not in elsewhere}
    names |= {f"_{f.name.upper()}" for f in fields(Limits)}
    assert sorted(n for n in names if f"{n}`" not in docs) == []


def test_where_scratch_is_named_no_temporary_folder_is_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Like a container with a read-only root and no /tmp.
    def none_there() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "gettempdir", none_there)
    named = {"PBRS_REDIS_URL": "redis://x/0", "PBRS_FARM_SCRATCH": str(tmp_path)}
    assert config_from_environment(named).scratch == tmp_path


def test_scratch_is_created_and_a_file_in_its_place_is_one_line(tmp_path: Path) -> None:
    config = FarmConfig(Secret(""), worker="w", scratch=tmp_path / "deep" / "scratch")
    make_scratch(config)
    assert config.scratch.is_dir()
    (tmp_path / "file").write_text("")
    for scratch in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(MachineFailed, match="PBRS_FARM_SCRATCH"):
            make_scratch(replace(config, scratch=scratch))
