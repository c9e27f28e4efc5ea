"""The tables of the docs come from the benches' JSON, and stand between markers."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.light import denoised, guided, lux
from benchmarks.light.light_tables import written_tables
from benchmarks.light.measured_views import EIGHT
from benchmarks.light.table_rows import (
    CYCLES_WAYS,
    DENOISED_COUNTS,
    DENOISED_WAYS,
    LUXCORE_ENGINES,
    LUXCORE_ROOMS,
    PRESETS,
    RENDERED_HOMES,
    TABLES,
)
from benchmarks.renderers import cycles
from pbrs_farm.assets.homes_package import example_homes
from pbrs_farm.core.recipe import recipe_from_name
from tests.benchmarks.test_equal_time import MEASURED

REPO = Path(__file__).parents[2]
MACHINE = {"cpu": "AMD EPYC", "cores": 2, "load_1min": 1.95}


def light_figures() -> dict[str, float]:
    scenes = ["door", "globe", "sunlit", "shade"]
    scenes += [
        f"{h}_{k}" for h in ("2bedroomapartment", "studio", "3bedroomapartment") for k in (0, 1)
    ]
    found = {f"light.{key}_{name}": value for key in scenes for name, value in MEASURED.items()}
    homes = {f"light.homes_{p}ratio{s}": 0.4 for p in ("", "median_") for s in ("", "_spread")}
    return found | homes | {"light.mutation_cost": 1.4, "light.compiled_by_another_camera": 0.0}


def luxcore_figures() -> dict[str, float]:
    errors = ("relmse", "median", "mean_over_path", "blocks_over_path")
    engines = ("path", "metropolis", *LUXCORE_ENGINES)
    names = ["cpu_s", *(f"{e}_{x}" for e in engines for x in errors)]
    names += [f"{p}{x}_ratio" for p in ("", "path_") for x in ("relmse", "median")]
    scenes = LUXCORE_ROOMS | RENDERED_HOMES
    medians = {
        f"light.vs_luxcore_{name}{end}": 9.0
        for name in ("path", "metropolis")
        for end in ("", "_median")
    }
    return {f"light.luxcore_{key}_{name}": 0.5 for key in scenes for name in names} | medians


def cycles_figures() -> dict[str, float]:
    effort = cycles.Effort(4, 3, 32, 512, 4)
    pictures = np.random.default_rng(0).gamma(2.0, size=(4, 12, 16))
    long = np.random.default_rng(1).gamma(2.0, size=(12, 16, 3)).astype(np.float32)
    run = cycles.Run(pictures, 32, 2.0, 0.5)
    views = [
        cycles.View(
            f"{home}_{k}", run, run, dict.fromkeys(CYCLES_WAYS, run), long, long, (long, long)
        )
        for home in RENDERED_HOMES
        for k in (0, 1)
    ]
    return {name: value for name, (value, _unit) in cycles.figures_of(views, effort).items()}


def growth_figures() -> dict[str, float]:
    cases = {"triangles": (100_000, 1_000_000, 4_000_000)}
    cases |= {"lamps": (10, 100, 500), "lamps_of_a_home": (10, 100, 500)}
    ends = ("us", "pilot_s", "load_s", "times", "small_times")
    found = {f"light.{k}_{n}_{e}": 1.0 for k, some in cases.items() for n in some for e in ends}
    return found | {"light.growth_peak_mb": 1300}


def all_figures() -> dict[str, dict[str, Any]]:
    """Bench -> figures as its main writes them."""
    errors = {(way, n): [(1.0, 0.1, 0.05)] * 8 for way in DENOISED_WAYS for n in DENOISED_COUNTS}
    rooms = [{"indoor": 40.0, "outdoor": 300.0, "lit_by": ["lamps", "windows"]}]
    lit = {e: v for e, (v, _unit) in lux._figures_of(rooms).items()}
    chosen = {v.key: guided.Choosing(1.006, 0.002, 3, 0.0061) for v in EIGHT}
    homes = ("studio", "3bedroomapartment", "2bedroomapartmentwithbowwindow")
    return {
        "light": light_figures(),
        "luxcore": luxcore_figures(),
        "cycles": cycles_figures(),
        "growth": growth_figures(),
        "denoised": denoised.figures_of(errors, recipe_from_name("fast").light.spp)[0]
        | {"light.reference_spp": 1024},
        "guided": guided.figures_of(chosen)[0],
        "view": {"view.fast_s": 9.0, "view.fast_first_s": 12.0, "view.labels_s": 0.1},
        "demo": {"demo.seconds": 11.0, "demo.peak_mb": 900.0, "demo.views": 10},
        "lux": {f"lux.{h.name.lower()}_{e}": v for h in example_homes() for e, v in lit.items()},
        "presets": {
            f"presets.{h}_{p}_{e}": 1.0 for h in homes for p in PRESETS for e in ("cpu_s", "noise")
        },
    }


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    """A folder of small reports of every bench."""
    folder = tmp_path / "bench"
    folder.mkdir()
    for bench, figures in all_figures().items():
        write_report_of(folder, bench, figures)
    return folder


def write_report_of(
    folder: Path, bench: str, figures: dict[str, Any], commit: str = "c687b25cbdd5"
) -> None:
    report = {"figures": figures, "machine": MACHINE, "commit": commit}
    (folder / f"{bench}.json").write_text(json.dumps(report), encoding="utf-8")


def page_of(tmp_path: Path, *names: str) -> Path:
    """The only page of a docs folder, with an old table of each name."""
    page = tmp_path / "docs/lab/costs.md"
    page.parent.mkdir(parents=True)
    blocks = [f"before {n}\n<!-- bench:{n} -->\nold {n}\n<!-- /bench -->\nafter" for n in names]
    page.write_text("\n".join(blocks), encoding="utf-8")
    return page


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_written_whole_with_its_commit_command_and_load(
    tmp_path: Path, reports: Path, name: str
) -> None:
    page = page_of(tmp_path, name)
    assert written_tables(tmp_path / "docs", reports) == [f"{page}: {name} written"]
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"before {name}\n<!-- bench:{name} -->\n\n|")
    assert text.endswith("<!-- /bench -->\nafter")
    assert "old" not in text
    tables = re.findall(r"(?:^\|.*\n){3,}", text, re.M)
    assert tables
    for rows in tables:
        assert len({line.count("|") for line in rows.splitlines()}) == 1
    assert f"`{TABLES[name].command}` (c687b25: 2 cores of AMD EPYC, load 1.9" in text
    # Once more, and nothing changes.
    written_tables(tmp_path / "docs", reports)
    assert page.read_text(encoding="utf-8") == text


def test_a_table_outside_the_lab_book_names_no_commit(tmp_path: Path, reports: Path) -> None:
    page = page_of(tmp_path, "compare")
    page = page.rename(tmp_path / "docs/compare.md")
    written_tables(tmp_path / "docs", reports)
    text = page.read_text(encoding="utf-8")
    assert (
        f"*`{TABLES['compare'].command}`; commit and machine: the [lab book](lab/light.md).*"
        in text
    )
    assert "c687b25" not in text


def test_a_table_whose_report_is_missing_stays_and_is_named(tmp_path: Path, reports: Path) -> None:
    (reports / "demo.json").unlink()
    page = page_of(tmp_path, "view", "lux")
    said = written_tables(tmp_path / "docs", reports)
    assert said[0].startswith(f"{page}: view stays as it is: there is no {reports}/demo.json")
    assert said[1:] == [f"{page}: lux written"]
    assert "old view" in page.read_text(encoding="utf-8")


def test_a_table_whose_report_lacks_a_figure_stays_and_names_it(
    tmp_path: Path, reports: Path
) -> None:
    figures = all_figures()["light"]
    del figures["light.mutation_cost"]
    write_report_of(reports, "light", figures)
    page = page_of(tmp_path, "light")
    (said,) = written_tables(tmp_path / "docs", reports)
    assert "light stays as it is: light: no figure light.mutation_cost" in said
    assert "old light" in page.read_text(encoding="utf-8")


def test_tables_of_two_commits_are_told(tmp_path: Path, reports: Path) -> None:
    write_report_of(reports, "lux", all_figures()["lux"], "0a53a10d86d1+")
    page = page_of(tmp_path, "lux", "light")
    said = written_tables(tmp_path / "docs", reports)
    assert said[-1] == "tables are of 2 commits: 0a53a10d86d1+: lux; c687b25cbdd5: light"
    assert "(0a53a10+: 2 cores" in page.read_text(encoding="utf-8")


def test_a_marker_of_no_table_is_rejected_by_name(tmp_path: Path, reports: Path) -> None:
    page_of(tmp_path, "nothing")
    with pytest.raises(ValueError, match="no table 'nothing'; of light, view"):
        written_tables(tmp_path / "docs", reports)


def test_every_table_has_its_place_in_the_docs() -> None:
    pages = [p.read_text(encoding="utf-8") for p in sorted((REPO / "docs").rglob("*.md"))]
    found = [name for text in pages for name in re.findall(r"^<!-- bench:(\w+) -->$", text, re.M)]
    assert sorted(found) == sorted(TABLES)
    assert sum(text.count("<!-- /bench -->") for text in pages) == len(found)
