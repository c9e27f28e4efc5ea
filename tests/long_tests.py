"""The marker `quick(n)`: `make test` runs n cases of a test, evenly chosen, and `make test-all` the others."""

from __future__ import annotations

from collections import defaultdict

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the other cases of a test marked quick as long."""
    cases: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("quick"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for same in cases.values():
        marker = same[0].get_closest_marker("quick")
        n_quick = marker.args[0] if marker else 0
        for number, item in enumerate(same):
            if number and number * n_quick // len(same) == (number - 1) * n_quick // len(same):
                item.add_marker("long")
