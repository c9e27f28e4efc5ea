"""A set's cost is its samples, homes and pixels times their unit costs, times a price."""

from __future__ import annotations

import json
from datetime import date

import pytest

from pbrs_farm.cli import main
from pbrs_farm.commands.set_file import set_from_bytes, set_from_word
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run.costs import cost_of_run, measured, megasamples
from pbrs_farm.run.plan import wanted
from pbrs_farm.sets.data_set import shipped_sets
from pbrs_farm.sets.estimate_set import BillLine, bill_text, estimate_set, prices

SET = """
[render]
recipe = "fast"
modes = ["{modes}"]
size = "1000x500"
set = ["light.spp=20"]
[part.views]
homes = ["made:1..600"]
views = 5
"""


def of(modes: str = "mlt_il_ol", more: str = "") -> str:
    return SET.replace("{modes}", modes) + more


def test_light_is_samples_times_the_cost_of_one() -> None:
    lit = estimate_set(set_from_bytes(of().encode(), "a.toml"))
    plain = estimate_set(set_from_bytes(of("opengl_dl").encode(), "a.toml"))
    m = measured()
    # Two groups of light of 20 samples in each of half a million pixels, in 3,000 views of 600 homes.
    samples = 3_000 * 2 * 20 * 0.5
    light_s = samples * m["light_cpu_s"] + 600 * m["daylight_cpu_s"]
    light_s += 3_000 * 0.5 * m["develop_cpu_s"]
    assert (lit.houses, lit.views) == (600, 3_000)
    assert lit.cpu_hours - plain.cpu_hours == pytest.approx(light_s / 3600, abs=0.02)
    assert lit.gpu_hours == pytest.approx(samples * m["light_gpu_s"] / 3600, abs=0.01)
    assert plain.gpu_hours == 0
    assert plain.cpu_hours == plain.cpu_hours_beside_gpu
    assert lit.gigabytes > plain.gigabytes


def test_dropped_light_counts_beside_the_sum(capsys: pytest.CaptureFixture[str]) -> None:
    dropped = estimate_set(set_from_bytes(of().encode(), "a.toml"))
    text = of().replace("[part", "drop_radiance = false\n[part", 1)
    stored = estimate_set(set_from_bytes(text.encode(), "a.toml"))
    assert (stored.radiance_kept, dropped.radiance_kept) == (("views",), ())
    radiance = 3_000 * 500_000 * measured()["radiance_bytes"] / 1e9
    assert stored.gigabytes - dropped.gigabytes == pytest.approx(radiance, abs=0.02)
    assert stored.files - dropped.files == 3_000
    for estimate in (stored, dropped):
        assert estimate.gigabytes_with_radiance == stored.gigabytes
        assert estimate.gigabytes_without_radiance == dropped.gigabytes
    assert main(["estimate", "indoor-1k"]) == 0
    assert "GB with it" in capsys.readouterr().out


def test_a_walk_has_its_frames_and_a_pair_two_pictures() -> None:
    walk = recipe_from_name("fast", {"cameras.source": "walk", "cameras.walk_frames": "12"})
    assert cost_of_run(walk, wanted([], []), 4).n_views == 48
    pairs = recipe_from_name("fast", {"cameras.stereo_m": "0.1"})
    assert cost_of_run(pairs, wanted([], [], 3), 4).n_views == 24
    assert megasamples(pairs) == pytest.approx(2 * pairs.light.spp * 640 * 480 / 1e6)


def test_forms_add_only_bytes() -> None:
    plain = estimate_set(set_from_bytes(of().encode(), "a.toml"))
    more = estimate_set(set_from_bytes(of(more="[form.coco]\n[form.hdf5]\n").encode(), "a.toml"))
    pixels = 2 * 3_000 * 500_000
    assert more.gigabytes - plain.gigabytes == pytest.approx(
        pixels * measured()["form_bytes"] / 1e9, abs=0.02
    )
    assert more.cpu_hours == plain.cpu_hours


def test_every_price_has_a_source_and_a_date() -> None:
    assert len(prices()) >= 3
    for cloud, rates in prices().items():
        for price in rates.values():
            assert price.source.startswith("https://"), (cloud, price.what)
            assert date(2026, 1, 1) <= price.date
        assert rates["cpu_hour_spot"].usd < rates["cpu_hour"].usd


@pytest.mark.parametrize("name", shipped_sets())
def test_every_shipped_set_has_an_estimate(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    estimate = estimate_set(set_from_word(name))
    for cloud in estimate.clouds:
        usd = prices()[cloud.cloud]
        assert cloud.on_demand == pytest.approx(
            estimate.cpu_hours * usd["cpu_hour"].usd, rel=0.01, abs=0.01
        )
        assert cloud.storage_a_month == pytest.approx(
            estimate.gigabytes * usd["gb_month"].usd, rel=0.01, abs=0.01
        )
        assert (cloud.gpu is None) == ("gpu_hour" not in usd)
    assert main(["estimate", name, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["views"] == estimate.views
    assert main(["estimate", name]) == 0
    output = capsys.readouterr().out
    assert all(word in output for word in ("CPU hours", *prices(), f"{estimate.views:,}"))


def test_a_bill_is_amounts_times_prices(capsys: pytest.CaptureFixture[str]) -> None:
    estimate = estimate_set(set_from_word("indoor-1k"))
    for cloud, usd in prices().items():
        lines = {line.what: line for line in estimate.bill(cloud)}
        cpu = lines["CPU hours"]
        assert cpu.amount == estimate.cpu_hours
        assert cpu.usd == pytest.approx(cpu.amount * usd["cpu_hour"].usd, abs=0.01)
        assert cpu.read_on == usd["cpu_hour"].date.isoformat()
        written = lines["objects written"]
        price = usd["put_1000"].usd if "put_1000" in usd else None
        assert (written.usd is None) == (price is None)
        if price is not None:
            assert written.usd == pytest.approx(estimate.files * price / 1000, abs=0.01)
    assert main(["estimate", "indoor-1k", "--cloud", "aws", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == ["AWS"]


def test_a_bill_has_a_dash_for_an_unknown_price(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "indoor-1k", "--cloud", "AWS"]) == 0
    (line,) = [
        x for x in capsys.readouterr().out.splitlines() if x.startswith("GPU hours of light, spot")
    ]
    assert line.split()[-2:] == ["-", "-"]


def test_a_bill_has_zero_for_a_free_part() -> None:
    free = BillLine(what="a", amount=2.0, usd_each=0.0, usd=0.0, of="x", read_on="2026-01-01")
    unknown = BillLine(what="b", amount=2.0, usd_each=None, usd=None, of="", read_on="")
    _head, *lines = bill_text([free, unknown]).splitlines()
    assert lines[0].split()[:4] == ["a", "2.00", "0", "0.00"]
    assert lines[1].split() == ["b", "2.00", "-", "-"]


def test_a_cloud_without_prices_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "indoor-1k", "--cloud", "Azure"]) == 1
    assert "Azure: no prices of this cloud (of AWS" in capsys.readouterr().err
