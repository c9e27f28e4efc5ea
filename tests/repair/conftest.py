"""Fixtures of the repair tests."""

from __future__ import annotations

import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import RepairReport, repair
from tests.repair.embree import EmbreeOccluder


@pytest.fixture(scope="session")
def home() -> House:
    """The built-in home as read."""
    return builtin_home()


@pytest.fixture(scope="session")
def repaired(home: House) -> tuple[House, RepairReport]:
    """The built-in home repaired and measured."""
    return repair(home, RepairFields(), occluder_from=EmbreeOccluder)
