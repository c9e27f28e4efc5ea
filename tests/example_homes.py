"""The example homes for tests marked `homes`: `make test` fetches them before the tests run."""

from __future__ import annotations

import pytest

from pbrs_farm.assets import homes


def example_homes() -> homes.Package:
    """The fetched package; skips where it could not be fetched, which CI forbids."""
    package = homes.cached()
    if package is None:
        pytest.skip("the example homes are not fetched: pbrs-farm homes --fetch")
    return package
