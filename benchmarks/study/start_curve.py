"""What ImageNet's start brings, by views: two commands of minutes each, for a machine with a GPU.

    python -m benchmarks.study.start_curve render --seconds 480 --jobs 16      homes, while time is left
    python -m benchmarks.study.start_curve train --seconds 520 --together 6    trainings, while time is left
    python -m benchmarks.study.start_curve table                               what there is so far
    python -m benchmarks.study.start_curve table --install                     its best normals ship with the package

render: made homes at 160x120 by recipe fast, those that judge first; `pbrs-farm homes --furniture`
goes before, or --generated furnishes and dresses them from what the program generates, which
downloads nothing. train: normals by plan lite, from nothing and from ImageNet at equal steps, most
views first, judged on the homes that never train. What is cut off goes on with the same command.
--copy FOLDER: few and small files of what is done so far, again after each part.

Effects: out/study/start (or PBRS_STUDY_FOLDER/start): homes, runs, results.json and table.md.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import statistics
import sys
import tarfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.study.rendered import FOLDER
from benchmarks.study.trainings import (
    FIRST_JUDGE,
    SMALL_PICTURES,
    Training,
    gains_by_home,
    row_of_run,
    run_program,
    train_all,
)

START: Final = FOLDER / "start"
HOMES: Final = START / "homes"
POINTS: Final = (1600, 400, 100)
INITS: Final = ("imagenet", "none")
MADE_BY: Final = (
    "pbrs-farm homes --furniture",
    "python -m benchmarks.study.start_curve render",
    "python -m benchmarks.study.start_curve train",
)
_HELD_OUT: Final = "made"
_FIELDS: Final = (
    "judge_every=0",
    "checkpoint_every=500",
    "log_every=100",
    "final_views=200",
    "threads=2",
)
# Behind homes that come empty.
_GENERATED: Final = ("--furnish", "empty", "--catalogue", "generated")
_LOG: Final = START / "program.log"
_SHARD: Final = 600  # views, about 12 MB


def _folder(init: str, views: int, seed: int) -> Path:
    return START / "runs" / f"{init}_{views}views_seed{seed}"


def main(words: Sequence[str]) -> None:
    """One of the three commands."""
    args = _arguments(words)
    if args.command == "render":
        _render(args)
    elif args.command == "train":
        _train(args)
    else:
        print(_tell(args.copy))
        if args.install:
            _install()


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.study.start_curve")
    commands = parser.add_subparsers(dest="command", required=True)
    render = commands.add_parser("render")
    render.add_argument("--homes", type=int, default=160, help="that train")
    render.add_argument("--judges", type=int, default=12, help="homes that judge")
    render.add_argument("--views", type=int, default=10, help="of a home, at most")
    render.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    render.add_argument("--generated", action="store_true", help="no furniture of the package")
    render.add_argument("--modes", nargs="+", default=["mlt_il_ol"])
    train = commands.add_parser("train")
    train.add_argument("--steps", type=int, default=3000, help="of each training")
    train.add_argument("--batch", type=int, default=16, help="views a step")
    train.add_argument("--seeds", type=int, default=2)
    train.add_argument("--together", type=int, default=1, help="trainings at a time")
    train.add_argument("--points", type=int, nargs="+", default=list(POINTS), help="views")
    train.add_argument("--on", nargs="+", default=[], metavar="NAME=PLACE", help="judges, too")
    train.add_argument("--set", nargs="+", default=[], metavar="FIELD=VALUE", help="of the plan")
    train.add_argument("--place", default="", help="shards of these homes, packed before")
    table = commands.add_parser("table")
    table.add_argument("--install", action="store_true", help="into pbrs_farm/study/weights")
    for command in (render, train, table):
        command.add_argument(
            "--copy", type=Path, metavar="FOLDER", help="results, at most 16 MB each"
        )
    for command in (render, train):
        command.add_argument("--seconds", type=float, default=0, help="stop then; 0 = at the end")
    return parser.parse_args(words)


def _render(args: argparse.Namespace) -> None:
    began = time.monotonic()
    last = FIRST_JUDGE + args.judges - 1
    option, own = (",furniture=none", _GENERATED) if args.generated else ("", ())
    homes = [f"made:{span}{option}" for span in (f"{FIRST_JUDGE}..{last}", f"1..{args.homes}")]
    words = [
        "run", *homes, *own, *SMALL_PICTURES, "--modes", *args.modes,
        "--views", str(args.views), "--jobs", str(args.jobs), "--out", str(HOMES),
    ]  # fmt: skip
    code = run_program(words, began + args.seconds if args.seconds else None, _LOG)
    views = list(HOMES.glob("houses/*/views/*/view.json"))
    row = {
        "homes": len({path.parents[2] for path in views}), "views": len(views),
        "seconds": round(time.monotonic() - began, 1), "jobs": args.jobs, "code": code,
        "step_s": _seconds_a_step(),
    }  # fmt: skip
    with (START / "rendered.jsonl").open("a") as file:
        file.write(json.dumps(row) + "\n")
    print(json.dumps(row), flush=True)
    if args.copy:
        _copy_views(args.copy)


def _seconds_a_step() -> dict[str, float]:
    """Step -> the median of its seconds, of homes and views alike."""
    seconds: dict[str, list[float]] = {}
    for path in HOMES.glob("houses/*/done/*.json"):
        marker = json.loads(path.read_bytes())
        seconds.setdefault(marker["step"], []).append(marker["seconds"])
    return {step: round(statistics.median(values), 2) for step, values in sorted(seconds.items())}


def _copy_views(out: Path) -> None:
    """Shards of colour and normals, and a sheet of pictures to look at."""
    shards = START / "shards"
    shutil.rmtree(shards, ignore_errors=True)
    words = ["--layers", "colour", "normal", "--colour", "jpeg:95", "--shard-size", str(_SHARD)]
    run_program(
        ["pack", str(HOMES), "--modes", "mlt_il_ol", *words, "--out", str(shards)], None, _LOG
    )
    out.mkdir(parents=True, exist_ok=True)
    for path in (*shards.glob("*"), START / "rendered.jsonl"):
        if path.is_file():
            shutil.copy(path, out)
    _write_sheet(out / "views.jpg")


def _write_sheet(path: Path) -> None:
    """Forty pictures, spread over all views."""
    import numpy as np

    from pbrs_farm.images import jpeg_from_array
    from pbrs_farm.views.open_views import open_views
    from pbrs_farm.views.view_sample import SampleRequest

    views = list(open_views(str(HOMES)).only(request=SampleRequest(("colour",))))
    chosen = [views[round(k * (len(views) - 1) / 39)] for k in range(40)]
    pictures = [view.sample(SampleRequest(("colour",))).colour for view in chosen]
    rows = [np.concatenate(pictures[k : k + 8], axis=1) for k in range(0, 40, 8)]  # type: ignore[arg-type]
    path.write_bytes(jpeg_from_array(np.concatenate(rows)))


def _train(args: argparse.Namespace) -> None:
    from pbrs_farm.study.training.prediction import device_of
    from pbrs_farm.study.training_plan import plan_of

    deadline = time.monotonic() + args.seconds if args.seconds else None
    place = args.place or str(HOMES)
    held, n_views = held_out(place)
    points = dict.fromkeys(min(views, n_views) for views in args.points)
    fields = [f"steps={args.steps}", f"batch={args.batch}", *_FIELDS, *args.set]
    judges = (f"{_HELD_OUT}={place}", *args.on)
    trainings = []
    for seed, views, init in itertools.product(range(args.seeds), points, INITS):
        train = (
            "train", "normals", place, "--plan", "lite", "--init", init, "--views", str(views),
            "--seed", str(seed), "--hold-out", *held,
            *(word for field in fields for word in ("--set", field)),
        )  # fmt: skip
        trainings.append(Training(_folder(init, views, seed), train, judges))
    device = device_of(plan_of("normals", "lite"))
    said = f"{n_views} views train, {len(held)} homes judge, {len(trainings)} trainings on {device}"
    print(said, flush=True)
    train_all(trainings, args.together, deadline, lambda: _tell(args.copy))
    print(_tell(args.copy), flush=True)


def held_out(place: str) -> tuple[list[str], int]:
    """The homes of a place that judge, by name, and how many views the others have."""
    from pbrs_farm.core.house_split import home_of
    from pbrs_farm.views.open_views import open_views

    refs = open_views(place).refs
    homes = [home_of(ref.house) for ref in refs]
    held = sorted({home for home in homes if int(home.rpartition("-")[2]) >= FIRST_JUDGE})
    if not held or len(held) == len(set(homes)):
        raise RuntimeError(f"{place}: no home that judges, or none that trains: render goes first")
    return held, sum(home not in held for home in homes)


def _rows() -> list[dict[str, Any]]:
    """What each training that is judged was, and its evaluations."""
    rows = []
    for path in sorted((START / "runs").glob("*/evaluation/evaluation.json")):
        init, views, seed = path.parents[1].name.split("_")
        rows.append(row_of_run(path) | {
            "init": init, "views": int(views.removesuffix("views")),
            "seed": int(seed.removeprefix("seed")),
        })  # fmt: skip
    return rows


def _tell(copy: Path | None) -> str:
    """Write results.json and table.md, and with the best weights into the folder of copies; the table."""
    rows = _rows()
    if not rows:
        return "nothing is judged yet"
    text, figures = start_table(rows), start_figures(rows)
    (START / "results.json").write_text(json.dumps({"figures": figures, "rows": rows}, indent=1))
    (START / "table.md").write_text(text)
    if copy:
        copy.mkdir(parents=True, exist_ok=True)
        for name in ("results.json", "table.md"):
            shutil.copy(START / name, copy)
        _copy_best(rows, copy)
    return text


def _copy_best(rows: Sequence[dict[str, Any]], out: Path) -> None:
    """The run that errs least of those on most views: packed with its card, and its page."""
    packed = _packed_best(rows)
    shutil.copy(START / "runs" / packed.name / "evaluation/index.html", out / "best.html")
    beside = out / "best.tar.part"
    with tarfile.open(beside, "w") as tar:
        tar.add(packed, packed.name)
    beside.replace(out / "best.tar")


def _packed_best(rows: Sequence[dict[str, Any]]) -> Path:
    """The folder of the packed run, which is called as the run."""
    from pbrs_farm.study.judging.packed_weights import pack_weights

    most = max(row["views"] for row in rows)
    best = min((row for row in rows if row["views"] == most), key=_held_out_deg)
    out = START / "packed" / best["run"]
    return pack_weights(START / "runs" / best["run"], out, made_by=MADE_BY).root


def _install() -> None:
    from pbrs_farm.study.judging.packed_weights import SHIPPED

    shutil.copytree(_packed_best(_rows()), SHIPPED / "normals", dirs_exist_ok=True)


def _held_out_deg(row: dict[str, Any], part: str = "") -> float:
    one = row["judged"][_HELD_OUT]
    mean = one["parts"]["network"].get(part) if part else one["figures"]["network"]["mean_deg"]
    return float(mean) if mean is not None else float("nan")


def start_figures(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """study.curve_views, and study.init_gain at each number of views that both starts were trained on.

    The gain is degrees of the mean over held-out homes, at equal seeds, with the bounds that 90 % of
    resamples of the homes lie in.
    """
    from pbrs_farm.study.judging.evaluation import mean_interval

    figures = {"study.curve_views": float(max(row["views"] for row in rows))}
    for views in sorted({row["views"] for row in rows}):
        groups = {
            (row["init"], row["seed"]): row["judged"][_HELD_OUT]["groups"]
            for row in rows
            if row["views"] == views
        }
        none, imagenet = (
            {s: of for (init, s), of in groups.items() if init == name} for name in INITS[::-1]
        )
        gains = gains_by_home(none, imagenet)
        if not gains:
            continue
        name = f"study.init_gain_{views}"
        figures[name] = round(statistics.fmean(gains), 2)
        figures[f"{name}_low"], figures[f"{name}_high"] = (
            round(x, 2) for x in mean_interval(gains)
        )
    return figures


def start_table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a row a start and number of views, what looks at no picture last, a table a judge."""
    from pbrs_farm.study.judging.figure_text import markdown, spread_text
    from pbrs_farm.study.metrics.error_parts import PARTS

    tables = []
    for judge in dict.fromkeys(name for row in rows for name in row["judged"]):
        judged = [row for row in rows if judge in row["judged"]]
        # The mean normal of the most views stands for all.
        last = max(judged, key=lambda row: int(row["views"]))
        first = last["judged"][judge]
        parts = [part for part in PARTS if part in first["parts"]["network"]]
        lines = []
        for views, init in sorted({(row["views"], row["init"]) for row in judged}):
            same = [row for row in judged if (row["views"], row["init"]) == (views, init)]
            means = [row["judged"][judge]["figures"]["network"]["mean_deg"] for row in same]
            cells = [spread_text("mean_deg", means)]
            for part in parts:
                own = [row["judged"][judge]["parts"]["network"][part] for row in same]
                cells.append(f"{statistics.fmean(own):.1f}")
            seen = statistics.fmean(row["training_deg"] for row in same)
            lines.append(
                [str(views), str(same[0]["homes"]), init, str(len(same)), f"{seen:.1f}", *cells]
            )
        still = last["baseline"]
        mean, own = first["figures"][still]["mean_deg"], first["parts"][still]
        lines.append(
            ["-", "-", still, "-", "-", f"{mean:.2f}", *(f"{own[part]:.1f}" for part in parts)]
        )
        shares = [f"{100 * first['shares'][part]:.0f} %" for part in parts]
        lines.append(["", "", "share of pixels", "", "", "", *shares])
        said = f"`{judge}`: {first['n_views']} views of {len(first['groups'])} homes or folders; degrees."
        tables.append(
            f"{said}\n\n{markdown(['views', 'homes', 'start', 'seeds', 'training', 'mean', *parts], lines)}"
        )
    steps = {(row["steps"], row["batch"]) for row in rows}
    how = " or ".join(f"{n:,} steps of {batch}" for n, batch in sorted(steps))
    gains = "\n".join(f"{name} {value:g}" for name, value in start_figures(rows).items())
    return f"Normals, plan lite at 160x120, {how} views.\n\n" + "\n\n".join([*tables, gains]) + "\n"


if __name__ == "__main__":
    main(sys.argv[1:])
