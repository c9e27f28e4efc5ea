"""A small SUNCG root on disk and its house, built once per module."""

from pathlib import Path

import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("suncg")
    suncg_root.write_root(folder)
    return folder


@pytest.fixture(scope="module")
def house(root: Path) -> House:
    return read_suncg(root, HOUSE, ReadFields())
