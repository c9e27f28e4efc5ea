"""NumPy's arrays as Dr.Jit may read them; no effects."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_SLACK: Final = 64  # values: more than a packet of any processor holds


def with_slack(values: NDArray[Any]) -> NDArray[Any]:
    """A copy of values (N,) with readable memory behind, as Dr.Jit reads whole packets past the last."""
    padded = np.zeros(len(values) + _SLACK, values.dtype)
    padded[: len(values)] = values
    return padded[: len(values)]
