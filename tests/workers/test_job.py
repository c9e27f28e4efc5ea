from __future__ import annotations

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from tests.workers.conftest import spec
from workers.client.estimate import estimate, seconds_per_view
from workers.client.farm_client import completed, new_spec
from workers.job import HouseEntry


def test_an_estimate_grows_with_the_job() -> None:
    small = estimate(spec(10), 2)
    large = estimate(spec(1000), 2)
    assert float(large["slot_hours"]) == pytest.approx(100 * float(small["slot_hours"]), rel=0.05)
    assert seconds_per_view(recipe_from_name("fast")) > seconds_per_view(
        recipe_from_name("preview")
    )


def test_a_job_is_the_same_job_in_any_order_and_another_with_another_recipe() -> None:
    houses = [HouseEntry(house_id=h, sha256=h * 8) for h in "abc"]
    preview = new_spec(recipe_from_name("preview"))
    job_id = completed(houses, preview)[1].job_id
    assert completed(houses[::-1], preview)[1].job_id == job_id
    assert completed(houses, new_spec(recipe_from_name("fast")))[1].job_id != job_id
    changed = [*houses[:2], HouseEntry(house_id="c", sha256="changed")]
    assert completed(changed, preview)[1].job_id != job_id
    with pytest.raises(BadInput, match="named twice"):
        completed([*houses, houses[0]], preview)
    with pytest.raises(BadInput, match="no house"):
        completed([], preview)
