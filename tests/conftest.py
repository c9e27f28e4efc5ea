"""Hooks of the whole suite."""

from __future__ import annotations

import tests.hypothesis_profiles  # noqa: F401  loads a profile before tests are imported
from pbrs_farm.crash_notes import set_watched
from tests.cpu_times import pytest_runtest_setup, pytest_runtest_teardown, pytest_terminal_summary
from tests.long_tests import pytest_collection_modifyitems
from tests.no_skips import pytest_make_collect_report, pytest_runtest_makereport
from tests.study_marker import one_thread, pytest_configure, pytest_ignore_collect

__all__ = [
    "one_thread",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_ignore_collect",
    "pytest_make_collect_report",
    "pytest_runtest_makereport",
    "pytest_runtest_setup",
    "pytest_runtest_teardown",
    "pytest_terminal_summary",
]

# IFC files are read in this process: a child for each would take a second.
set_watched()
