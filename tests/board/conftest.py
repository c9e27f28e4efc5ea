"""One small root, served once for the read-only tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.board.roots import write_root
from tests.board.served import served


@pytest.fixture(scope="session")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    return write_root(folder, {"a-1": ("0_0_1", "0_0_2", "0_1_0"), "b-2": ("0_0_4",)})


@pytest.fixture(scope="session")
def client(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    with served(str(root), tmp_path_factory.mktemp("cache")) as client:
        yield client
