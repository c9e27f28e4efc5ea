"""Hooks of the whole suite."""

from __future__ import annotations

import tests.hypothesis_profiles  # noqa: F401  loads a profile before tests are imported
from tests.cpu_times import pytest_runtest_setup, pytest_runtest_teardown, pytest_terminal_summary
from tests.long_tests import pytest_collection_modifyitems
from tests.no_skips import pytest_make_collect_report, pytest_runtest_makereport

__all__ = [
    "pytest_collection_modifyitems",
    "pytest_make_collect_report",
    "pytest_runtest_makereport",
    "pytest_runtest_setup",
    "pytest_runtest_teardown",
    "pytest_terminal_summary",
]
