"""Forms that only state numbers: sums of shares of an item's sizes, and solids by form."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.thing_materials import STEEL
from pbrs_farm.furnishings.things.forms import formed, number
from pbrs_farm.furnishings.things.maker import Maker


@pytest.mark.parametrize(
    ("cell", "value"),
    [("0", 0.0), (".03", 0.03), ("r", 0.1), ("-r", -0.1), ("1.5r", 0.15), ("2r-.02+t", 0.48)],
)
def test_a_number_is_a_sum_of_shares_of_sizes_and_metres(cell: str, value: float) -> None:
    assert number(cell, {"r": 0.1, "t": 0.3}) == pytest.approx(value)


def test_a_form_has_its_solids_and_a_form_of_code_none() -> None:
    m = Maker(np.random.default_rng(1), style_for(np.random.default_rng(1)))
    formed(m, "vase", 0, of=STEEL, r=0.05, t=0.3)
    formed(m, "vase", 11, of=STEEL, r=0.05, t=0.3)
    (jar, _), (lid, _) = m.finished("file", "name")
    assert jar.positions[:, 1].max() == pytest.approx(0.24)
    assert lid.positions[:, 1].max() == pytest.approx(0.3)
