"""Coarse-to-fine search equals scoring everything at full size; several views per sector differ."""

import numpy as np
import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.sample.eye_probes import ItemCounter
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.sector_search import Coarse, FullScores, best_first
from tests.sample.sampled_rooms import QUICK, IndependentLook, counter_of, furnished


def winners(
    house: House, fields: CameraFields, seed: int, counter: ItemCounter | None = None
) -> dict[str, bytes]:
    views = sample_cameras(house, fields, seed, counter or counter_of(house)).views
    return {v.id: v.camera.world_from_camera.tobytes() for v in views}


def differing(house: House, fields: CameraFields, seeds: range) -> tuple[int, int]:
    """(sectors whose winner differs from that of scoring all at full size, sectors)."""
    n_differ = n_sectors = 0
    counter = counter_of(house)
    for seed in seeds:
        quick = winners(house, fields, seed, counter)
        exact = winners(house, fields.model_copy(update={"exact": True}), seed, counter)
        ids = quick.keys() | exact.keys()
        n_differ += sum(quick.get(i) != exact.get(i) for i in ids)
        n_sectors += len(house.rooms) * fields.n_sectors
    return n_differ, n_sectors


@pytest.mark.long
@pytest.mark.parametrize(
    "rules",
    [
        {},
        pytest.param(
            {"max_item_fraction": 0.35, "max_wall_fraction": 0.55}, marks=pytest.mark.slow
        ),
    ],
)
def test_coarse_first_finds_the_winner_of_full_size_in_99_of_100_sectors(
    rules: dict[str, float],
) -> None:
    sizes = {"coarse_width_px": 20, "coarse_height_px": 15, "cell_m": 0.7}
    fields = QUICK.model_copy(update=sizes | rules)
    n_differ, n_sectors = differing(furnished(), fields, range(17))
    assert n_sectors == 102
    assert n_differ <= 1


@pytest.mark.slow
def test_coarse_first_finds_the_winner_at_the_papers_sizes_in_99_of_100_sectors() -> None:
    fields = CameraFields(cell_m=0.5)
    n_differ, n_sectors = differing(builtin_home(), fields, range(9))
    assert n_sectors == 108
    assert n_differ <= 1


def test_no_winner_is_filled_by_one_object_or_wall_beyond_its_bound() -> None:
    house = furnished()
    rules = {"max_item_fraction": 0.3, "max_wall_fraction": 0.5}
    fields = QUICK.model_copy(update=rules)
    look = IndependentLook(house)
    sampling = sample_cameras(house, fields, 0, counter_of(house))
    assert sampling.views
    assert sampling.report.refused["filled_by_one"] > 0
    n_pixels = fields.score_width_px * fields.score_height_px
    for view in sampling.views:
        for instance, n in look.pixels(view.camera).items():
            most = 0.5 if house.items[instance - 1].kind.is_structure else 0.3
            assert n / n_pixels <= most + 4 / n_pixels  # rays through an edge


def test_several_views_of_a_sector_show_objects_the_first_does_not() -> None:
    house = furnished()
    fields = QUICK.model_copy(update={"per_sector": 3})
    sampling = sample_cameras(house, fields, 0, counter_of(house))
    first_views = winners(house, QUICK, 0)
    by_sector: dict[int, list[str]] = {}
    for view in sampling.views:
        by_sector.setdefault(view.sector, []).append(view.id)
    assert any(len(ids) == 3 for ids in by_sector.values())
    assert len({v.id for v in sampling.views}) == len(sampling.views)
    for view in sampling.views:
        if view.id.endswith("_0"):
            assert (
                view.camera.world_from_camera.tobytes() == first_views[view.id.removesuffix("_0")]
            )

    # A second view adds an object, or shows more of one than the first.
    views = {v.id: v for v in sampling.views}
    for ids in by_sector.values():
        for second in ids[1:2]:
            first = ids[0]
            more = {k: n - views[first].objects.get(k, 0) for k, n in views[second].objects.items()}
            assert max(more.values()) > 0


def test_equal_scores_go_to_the_first_candidate() -> None:
    def rescore(which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.ones(len(which), bool), np.full(len(which), 0.5), np.zeros((len(which), 2))

    coarse = Coarse(np.ones(9, bool), np.full(9, 0.5))
    assert best_first(coarse, FullScores(rescore), margin=0.01) == 0


def test_a_candidate_that_fails_at_full_size_gives_way_to_the_next() -> None:
    keeps = np.arange(8) == 6

    def rescore(which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return keeps[which], np.linspace(0.9, 0.2, 8)[which], np.zeros((len(which), 2))

    coarse = Coarse(np.ones(8, bool), np.linspace(0.9, 0.2, 8))
    assert best_first(coarse, FullScores(rescore), margin=0.01) == 6
    keeps[6] = False
    assert best_first(coarse, FullScores(rescore), margin=0.01) is None
