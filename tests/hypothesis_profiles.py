"""Profiles of hypothesis: `quick` for `make test`; `pytest --hypothesis-profile=long` draws five times as many examples."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# The duration of an example depends on the machine's load rather than on the code.
settings.register_profile(
    "quick", deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=20
)
settings.register_profile("long", settings.get_profile("quick"), max_examples=100)
settings.load_profile("quick")


def examples(n: int) -> int:
    """A fifth of n in the profile `quick`, at least 5; n in the profile `long`."""
    return n if settings.get_current_profile_name() == "long" else max(5, n // 5)
