"""CPU seconds of each test, its fixtures and subprocesses included; the largest are listed after a run.

Wall times depend on the load of the machine. A test that takes seconds of CPU belongs to the marker `long`.
"""

from __future__ import annotations

import sys
from collections.abc import Generator
from typing import Any

import pytest

N_LISTED = 25
_START = pytest.StashKey[float]()


def _cpu_seconds() -> float:
    if sys.platform == "win32":
        return 0.0
    import resource

    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    """Keep the CPU seconds of this process before the test's fixtures."""
    item.stash[_START] = _cpu_seconds()
    yield


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    """Write the test's CPU seconds into its last report, which pytest-xdist passes on."""
    yield
    item.user_properties.append(("cpu_s", _cpu_seconds() - item.stash[_START]))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """List the tests with the most CPU seconds, and the sum of all."""
    seconds: dict[str, float] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            properties = dict(getattr(report, "user_properties", ()))
            if "cpu_s" in properties:
                seconds[report.nodeid] = properties["cpu_s"]
    if not any(seconds.values()):
        return
    total = f"{sum(seconds.values()) / 60:.1f} minutes of CPU in {len(seconds)} tests"
    terminalreporter.section(total)
    for name in sorted(seconds, key=lambda name: -seconds[name])[:N_LISTED]:
        terminalreporter.write_line(f"{seconds[name]:7.2f} s {name}")
