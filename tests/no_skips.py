"""With CI=true a skipped test counts as failed, so that no test passes by being skipped.

Tests with requirements that a machine may lack have a marker and a make target; they are deselected
rather than skipped.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from typing import Any

import pytest


def fail_skipped(report: Any) -> None:
    """Turn a report of "skipped" into "failed", except for expected failures."""
    if os.environ.get("CI") == "true" and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, which CI=true forbids: {report.longrepr}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport() -> Generator[None, Any, None]:
    """Skips of a test or its fixtures."""
    outcome = yield
    fail_skipped(outcome.get_result())


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report() -> Generator[None, Any, None]:
    """Skips of a whole module."""
    outcome = yield
    fail_skipped(outcome.get_result())
