"""The learning curve: how error falls with views and with homes. Renders, trains, judges, draws: hours.

Made and dressed homes at 160x120 by recipe fast, ten to a root; a point is a number of homes and of
views, judged on made homes that never train and on homes people drew, seen by a telephone in
another tone. Effects: out/study/curve (or PBRS_STUDY_FOLDER/curve). Every root, training and
judgement is kept and left out the next time: what is cut off goes on, smallest points first.

    python -m benchmarks.study.curve                              all of it
    python -m benchmarks.study.curve --homes 40 --seeds 1         as far as 40 homes, one seed
    python -m benchmarks.study.curve --homes 40 --render          the homes of those points alone
    python -m benchmarks.study.curve --on photos=/my/rgbd         photographs judge, too
    python -m benchmarks.study.curve --draw                       what there is, as table and plot
    python -m benchmarks.study.curve --words                      the `run` of each root, for the farm
    python -m benchmarks.study.curve --place s3://bucket/prefix   train on homes the farm has made
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pbrs_farm.cli
from benchmarks.study.curve_pictures import Point, curve_page, curve_picture
from benchmarks.study.kept_rows import kept
from benchmarks.study.rendered import FOLDER

CURVE: Final = FOLDER / "curve"
DOCS: Final = Path("docs/lab")
POINTS: Final = (
    (10, 50), (10, 100), (20, 100), (20, 200), (40, 100), (40, 400), (80, 400), (80, 800), (160, 1600),
)  # fmt: skip
"""Homes and views, in the order in which they are made: equal views of more homes among them."""
VIEWS: Final = 10  # of a home
BLOCK: Final = 10  # homes of a root
MANY: Final = 400  # views from which on one seed is enough

_LIGHT: Final = ("--size", "160x120", "--modes", "mlt_il_ol", "--recipe", "fast")
# Views are looked at as large as they are made: what a home costs is halved by it.
_SCORED: Final = ("--set", "cameras.score_width_px=160", "--set", "cameras.score_height_px=120")
_OTHER_CAMERA: Final = (
    "tone.camera=phone", "tone.white_balance=0.9", "tone.glare=0.04",
    "cameras.tilt_deg=4", "cameras.hfov_rad=1.15",
)  # fmt: skip
JUDGES: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "made": (("made:60101..60108",), ("--dress", "1", "--views", "6")),
    "drawn": (
        ("Studio", "2BedroomApartment", "3BedroomHouseWithAttic"),
        ("--dress", "7", "--views", "16", *(w for s in _OTHER_CAMERA for w in ("--set", s))),
    ),
}
"""Root that judges -> its homes, and the words of `run` behind them."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is asked for."""

    homes: int
    seeds: int
    jobs: int
    on: tuple[str, ...]
    fields: tuple[str, ...]  # of the plan, FIELD=VALUE
    place: str  # where the homes lie instead of our roots; "" = they are rendered here


def main(words: list[str] | None = None) -> None:
    """Make what is missing, point by point; the table and the plot after each."""
    args = _arguments(words or [])
    if args.words:
        print("\n".join(" ".join(run_words(name)) for name in all_roots()))
        return
    if args.render:
        for name in (*roots_of_homes(args.homes), *JUDGES):
            rendered(name, args.jobs)
        return
    wanted = Wanted(args.homes, args.seeds, args.jobs, tuple(args.on), tuple(args.set), args.place)
    for n_homes, n_views in () if args.draw else POINTS:
        if n_homes > wanted.homes:
            break
        _make_point(wanted, n_homes, n_views)
        draw(CURVE, CURVE)
    draw(CURVE, DOCS if args.docs else CURVE)


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.study.curve")
    parser.add_argument("--homes", type=int, default=160, help="go as far as points of so many")
    parser.add_argument("--seeds", type=int, default=3, help="of points below 400 views and 400")
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--on", nargs="+", default=[], metavar="PHOTOGRAPHS")
    parser.add_argument("--set", nargs="+", default=[], metavar="FIELD=VALUE", help="of the plan")
    parser.add_argument("--render", action="store_true", help="only render the homes")
    parser.add_argument("--draw", action="store_true", help="only draw what there is")
    parser.add_argument("--docs", action="store_true", help="draw into docs/lab")
    parser.add_argument("--words", action="store_true", help="print the `run` of each root")
    parser.add_argument("--place", default="", help="a root or store's URL with the homes, made")
    return parser.parse_args(words)


def all_roots() -> list[str]:
    """Every root's name: those that judge, those that train."""
    return [*JUDGES, *roots_of_homes(max(n_homes for n_homes, _ in POINTS))]


def roots_of_homes(n_homes: int) -> list[str]:
    """The roots that the first so many homes lie in, BLOCK homes each."""
    return [f"homes_{first:03}" for first in range(1, n_homes, BLOCK)]


def run_words(name: str) -> list[str]:
    """The command line behind `pbrs-farm` that makes a root."""
    if name in JUDGES:
        homes, words = JUDGES[name]
    else:
        first = int(name.rpartition("_")[2])
        homes = (f"made:{first}..{first + BLOCK - 1}",)
        words = ("--dress", "1", "--views", str(VIEWS))
    return ["run", *homes, *_LIGHT, *_SCORED, *words, "--out", str(CURVE / name)]


def _make_point(wanted: Wanted, n_homes: int, n_views: int) -> None:
    blocks = roots_of_homes(n_homes)
    places = [wanted.place] if wanted.place else [rendered(name, wanted.jobs) for name in blocks]
    on = [f"{name}={rendered(name, wanted.jobs)}" for name in JUDGES] + list(wanted.on)
    for seed in range(wanted.seeds if n_views <= MANY else 1):
        run = CURVE / "runs" / f"{n_homes}homes_{n_views}views_seed{seed}"
        # A run that was judged on all of this is done.
        if set(_judged(run)) >= {one.partition("=")[0] for one in on}:
            continue
        words = ["train", "normals", *places, "--views", str(n_views), "--seed", str(seed)]
        words += ["--hold-out", *(_others(wanted.place, n_homes) or ["none"])]
        for field in wanted.fields:
            words += ["--set", field]
        kept(run, "cost", lambda words=words, run=run: _command([*words, "--out", str(run)]))  # type: ignore[misc]
        judging = [word for one in on for word in ("--on", one)]
        _command(["evaluate", str(run), *judging, "--out", str(run / "evaluation")])


def rendered(name: str, jobs: int) -> str:
    """The root, made where it is missing. What it cost is written last: cost.json says it is whole."""
    out = CURVE / name

    def make() -> dict[str, float]:
        # A view that fails costs that view; the others train.
        code = pbrs_farm.cli.main([*run_words(name), "--jobs", str(jobs)])
        if code:
            print(f"{name}: some steps failed, the rest is used", file=sys.stderr)
        n_homes = len(list(out.glob("houses/*/done")))
        return {"homes": n_homes, "views": len(list(out.glob("houses/*/views/*/view.json")))}

    kept(out, "cost", make)
    return str(out)


def _command(words: list[str]) -> dict[str, float]:
    if pbrs_farm.cli.main(words):
        raise RuntimeError(f"{' '.join(words[:2])} failed; what is done is kept")
    return {"done": 1.0}


def _others(place: str, n_homes: int) -> list[str]:
    """Homes of a place that a point leaves out: made ones beyond the first so many, and all others."""
    if not place:
        return []
    from pbrs_farm.core.house_split import home_of
    from pbrs_farm.views.open_views import open_views

    ours = {f"made-{number}" for number in range(1, n_homes + 1)}
    return sorted({home_of(house) for house in open_views(place).homes} - ours)


def _judged(run: Path) -> dict[str, Any]:
    """What a run was judged on -> that evaluation, where there is one."""
    path = run / "evaluation" / "evaluation.json"
    rows = json.loads(path.read_text())["evaluations"] if path.exists() else []
    return {row["on"]: row for row in rows}


def draw(made: Path, out: Path) -> None:
    """Write curve.svg and curve.md of all that is judged below made."""
    points = [_point(made, n_homes, n_views) for n_homes, n_views in POINTS]
    judged = [point for point in points if point.errors]
    if not judged:
        print("nothing is judged yet")
        return
    page = curve_page(judged, [*_facts(made), *_to_come(points)])
    (out / "curve.svg").write_text(curve_picture(judged) + "\n")
    (out / "curve.md").write_text(page)
    print(page)


def _point(made: Path, n_homes: int, n_views: int) -> Point:
    """What the seeds of a point say; no errors where none was judged."""
    runs = sorted((made / "runs").glob(f"{n_homes}homes_{n_views}views_seed*"))
    errors: dict[str, list[float]] = {}
    for run in runs:
        judged = _judged(run)  # nothing of a run that still trains
        for name, row in judged.items():
            errors.setdefault(name, []).append(row["figures"]["network"]["mean_deg"])
        if judged:
            figures = json.loads((run / "figures.json").read_text())
            errors.setdefault("training", []).append(figures["network"]["train"]["mean_deg"])
    return Point(n_homes, n_views, {name: tuple(values) for name, values in errors.items()})


def _to_come(points: Sequence[Point]) -> list[str]:
    """How far the curve goes, in a sentence; none where it is whole."""
    lacking = [f"{p.views:,} views of {p.homes} homes" for p in points if not p.errors]
    if not lacking:
        return []
    command = "`python -m benchmarks.study.curve`"
    return [
        f"Not made yet: {', '.join(lacking)}. {command} goes on with them, and with more seeds."
    ]


def _facts(made: Path) -> list[str]:
    """Sentences of what was trained how, what it cost, and what knows no picture."""
    run = next(iter(sorted((made / "runs").glob("*/evaluation/evaluation.json"))))
    report = json.loads(run.read_text())
    plan, stored = report["run"]["plan"], report["trained"]["baseline_name"]
    said = [
        f"Plan {plan['name']} at {plan['width_px']}x{plan['height_px']}, {plan['steps']:,} steps of"
        f" {plan['batch']} views at every point, turned by {plan['turn_deg']:g} degrees."
    ]
    for row in report["evaluations"]:
        still = row["figures"][stored]["mean_deg"]
        said.append(
            f"`{row['on']}`: {row['n_views']} views, {len(row['groups'])} homes or folders;"
            f" the {stored} errs by {still:.1f} degrees."
        )
    rendered = [json.loads(path.read_text()) for path in sorted(made.glob("homes_*/cost.json"))]
    homes, views, cpu_s = (
        sum((row["figures"] | row)[name] for row in rendered)
        for name in ("homes", "views", "cpu_s")
    )
    if homes:
        said.append(
            f"Rendering took {cpu_s / homes:.0f} CPU-seconds a home and {cpu_s / views:.1f} a view,"
            f" the home's share included: {cpu_s / 3600:.1f} CPU-hours for {homes:.0f} homes"
            f" and {views:.0f} views."
        )
    trained = [json.loads(path.read_text())["cpu_s"] for path in made.glob("runs/*/cost.json")]
    if trained:
        said.append(
            f"A training took {statistics.fmean(trained):.0f} CPU-seconds; {len(trained)} of them"
            f" {sum(trained) / 3600:.1f} CPU-hours."
        )
    return said


if __name__ == "__main__":
    main(sys.argv[1:])
