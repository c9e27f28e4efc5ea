"""The example homes for tests marked `homes`: `make test` fetches them before the tests run."""

from __future__ import annotations

import pytest

from pbrs_farm.assets import homes_package


def example_homes() -> homes_package.Package:
    """The fetched package; skips if it could not be fetched, which CI forbids."""
    package = homes_package.cached()
    if package is None:
        pytest.skip("the example homes are not fetched: pbrs-farm homes --fetch")
    return package
