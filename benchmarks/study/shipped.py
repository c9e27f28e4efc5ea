"""Make the networks that ship with the package: render the homes, train, judge, pack.

    python -m benchmarks.study.shipped render --homes 160    training homes and held-out homes
    python -m benchmarks.study.shipped render --depth --homes 24    homes of depth, 50 OpenGL views each
    python -m benchmarks.study.shipped train                 all tasks; hours of a core without a GPU
    python -m benchmarks.study.shipped train normals --on photos=/my/rgbd
    python -m benchmarks.study.shipped install               the best seed of each task, if it beats a constant

Every command resumes: finished homes and judged runs are skipped. Effects: out/study/shipped (or
PBRS_STUDY_FOLDER/shipped); `install` writes deploy/weights.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pbrs_farm.cli
from benchmarks.study.free_pairs import free_pairs

FOLDER: Final = Path(os.environ.get("PBRS_STUDY_FOLDER", "out/study"))
HOMES: Final = FOLDER / "shipped/homes"
DRAWN: Final = FOLDER / "shipped/drawn"
DEPTH_HOMES: Final = FOLDER / "shipped/depth_homes"
RUNS: Final = FOLDER / "shipped/runs"
FIRST_HELD_OUT: Final = 60101
"""First seed of the generated homes that are never trained on."""
N_HELD_OUT: Final = 12
_N_HELD_OUT_OF_DEPTH: Final = 3
_SMALL: Final = (
    "--size", "160x120", "--recipe", "fast",
    "--set", "cameras.score_width_px=160", "--set", "cameras.score_height_px=120",
)  # fmt: skip
_DEPTH_CAMERAS: Final = (
    "cameras.hfov_rad=0.9", "cameras.hfov_spread=0.3", "cameras.per_sector=2",
    "cameras.min_score=0.6", "cameras.tilt_sd_deg=14", "cameras.height_min_m=0.9",
)  # fmt: skip
"""Many lenses, heights and tilts, and two views a sector."""
_DRAWN_HOMES: Final = ("Studio", "2BedroomApartment", "3BedroomHouseWithAttic")
_PHONE: Final = (
    "tone.camera=phone", "tone.white_balance=0.9", "tone.glare=0.04",
    "cameras.tilt_deg=4", "cameras.hfov_rad=1.15",
)  # fmt: skip
"""Camera of the drawn homes: another response and lens than those of the training views."""
_EVERY_TASK: Final = ("judge_every=0", "threads=1")
TASKS: Final[dict[str, tuple[int, int, tuple[str, ...]]]] = {
    "normals": (1600, 2, ("steps=3000", "batch=16", "final_views=200", "checkpoint_every=500")),
    "segmentation": (
        1000, 1,
        ("steps=1200", "batch=16", "n_classes=13", "average=0.99", "zoom=1.3", "hue=0.5", "final_views=100"),
    ),
    "boundaries": (600, 1, ("steps=700", "batch=8", "average=0.99", "hue=0.5", "final_views=32")),
    "depth": (
        0, 1,
        ("rays=true", "steps=1000", "batch=8", "threads=2", "average=0.995", "zoom=2.5", "gain=0.5", "gamma=0.5",
         "tint=0.2", "noise=0.03", "final_views=100"),
    ),
}  # fmt: skip
"""Task -> training views (0 = all), seeds, and changes to plan `lite`."""
_BEST: Final = {
    "normals": ("mean_deg", min), "segmentation": ("mean_iou", max), "boundaries": ("ods", max),
    "depth": ("abs_rel", min),
}  # fmt: skip
MADE_BY: Final = "python -m benchmarks.study.shipped render"
"""Command before the training, which records its own."""


def main(words: Sequence[str]) -> None:
    """Run one of the three commands."""
    args = _arguments(words)
    if args.command == "render":
        (render_for_depth if args.depth else render)(args.homes, args.jobs)
    elif args.command == "train":
        for task in args.tasks or TASKS:
            for seed in range(args.seeds or TASKS[task][1]):
                train(task, seed, args.on)
    else:
        install()


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.study.shipped")
    commands = parser.add_subparsers(dest="command", required=True)
    rendering = commands.add_parser("render")
    rendering.add_argument("--homes", type=int, default=160, help="training homes")
    rendering.add_argument("--depth", action="store_true", help="the homes of depth")
    rendering.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    training = commands.add_parser("train")
    training.add_argument("tasks", nargs="*", metavar="TASK", help=f"of {', '.join(TASKS)}")
    training.add_argument("--seeds", type=int, default=0, help="trainings of each task")
    training.add_argument("--on", nargs="+", default=[], metavar="NAME=PLACE", help="more judges")
    commands.add_parser("install")
    args = parser.parse_args(words)
    unknown = set(getattr(args, "tasks", ())) - set(TASKS)
    if unknown:
        parser.error(f"no task {min(unknown)!r}; expected {', '.join(TASKS)}")
    return args


def render(n_homes: int, n_jobs: int) -> None:
    """Render the generated homes, ten views each, and the drawn homes."""
    held_out = f"made:{FIRST_HELD_OUT}..{FIRST_HELD_OUT + N_HELD_OUT - 1}"
    jobs = ("--jobs", str(n_jobs))
    small = (*_SMALL, "--modes", "mlt_il_ol", *jobs)
    _render(
        held_out, f"made:1..{n_homes}", *small,
        "--dress", "1", "--views", "10", "--out", str(HOMES),
    )  # fmt: skip
    _render(
        *_DRAWN_HOMES, *small, *_set(_PHONE),
        "--dress", "7", "--views", "16", "--out", str(DRAWN),
    )  # fmt: skip


def render_for_depth(n_homes: int, n_jobs: int) -> None:
    """Render all views of the generated homes by OpenGL, for depth."""
    held_out = f"made:{FIRST_HELD_OUT}..{FIRST_HELD_OUT + _N_HELD_OUT_OF_DEPTH - 1}"
    _render(
        held_out, f"made:1..{n_homes}", *_SMALL, "--modes", "opengl_il", *_set(_DEPTH_CAMERAS),
        "--dress", "1", "--jobs", str(n_jobs), "--out", str(DEPTH_HOMES),
    )  # fmt: skip


def _set(fields: Sequence[str]) -> list[str]:
    return [word for field in fields for word in ("--set", field)]


def _render(*words: str) -> None:
    # A failed view is skipped; the others are used.
    if pbrs_farm.cli.main(["run", *words]):
        print("some steps failed, the finished views are used", file=sys.stderr)


def train(task: str, seed: int, judges: Sequence[str] = ()) -> None:
    """Train and judge one seed of a task, unless its evaluation exists."""
    from pbrs_farm.study.judging.packed_weights import shipped_run

    run = RUNS / f"{task}_seed{seed}"
    if (run / "evaluation/evaluation.json").exists():
        return
    n_views, _n_seeds, fields = TASKS[task]
    changes = _set((*_EVERY_TASK, *fields))
    if task == "depth":
        homes, init, modes = DEPTH_HOMES, str(shipped_run("normals")), ["--modes", "opengl_il"]
        places = (f"made={homes}", f"photos={free_pairs()}", *judges)
    else:
        homes, init, modes = HOMES, "imagenet", []
        places = (f"made={HOMES}", f"drawn={DRAWN}", *judges)
    _program(
        "train", task, str(homes), "--plan", "lite", "--init", init, "--seed", str(seed), *modes,
        "--views", str(n_views), "--hold-out", *held_out_homes(homes), *changes, "--out", str(run),
    )  # fmt: skip
    _program("evaluate", str(run), *(word for place in places for word in ("--on", place)))


def held_out_homes(root: Path) -> list[str]:
    """Names of a root's homes that judge."""
    from pbrs_farm.core.house_split import home_of
    from pbrs_farm.views.open_views import open_views

    homes = {home_of(ref.house) for ref in open_views(str(root)).refs}
    held_out = sorted(h for h in homes if int(h.rpartition("-")[2]) >= FIRST_HELD_OUT)
    if not held_out or len(held_out) == len(homes):
        raise RuntimeError(f"{root}: no training homes or no held-out homes; run `render` first")
    return held_out


def install() -> None:
    """Pack the best seed of each task and copy it into the package."""
    from pbrs_farm.study.judging.packed_weights import pack_weights, weights_folder

    for task in TASKS:
        reports = sorted(RUNS.glob(f"{task}_seed*/evaluation/evaluation.json"))
        if not reports:
            print(f"{task}: no judged run, left as it is")
            continue
        judged = {path.parents[1]: json.loads(path.read_text()) for path in reports}
        run = best_run(task, judged)
        baseline = json.loads((run / "figures.json").read_text())["baseline_name"]
        if lost := lost_places(task, judged[run], baseline):
            print(
                f"{task}: {run.name} is no better than {baseline} on {', '.join(lost)}, not installed"
            )
            continue
        made_by = [f"{MADE_BY}{' --depth' * (task == 'depth')}"]
        packed = pack_weights(run, RUNS / "packed" / task, made_by=made_by)
        shutil.copytree(packed.root, weights_folder() / task, dirs_exist_ok=True)
        print(f"{task}: {run.name} installed")


def best_run(task: str, reports: dict[Path, dict[str, Any]]) -> Path:
    """The run with the best figure of the task on held-out generated homes."""
    figure, best = _BEST[task]

    def score(run: Path) -> float:
        (row,) = (row for row in reports[run]["evaluations"] if row["on"] == "made")
        return float(row["figures"]["network"][figure])

    return best(reports, key=score)


def lost_places(task: str, report: dict[str, Any], baseline: str) -> list[str]:
    """Judges on which the network is no better than a constant prediction."""
    figure, best = _BEST[task]
    pairs = {row["on"]: row["figures"] for row in report["evaluations"]}
    constant = {on: rows[baseline][figure] for on, rows in pairs.items()}
    return [on for on, c in constant.items() if best(c, pairs[on]["network"][figure]) == c]


def _program(*words: str) -> None:
    if pbrs_farm.cli.main(list(words)):
        raise RuntimeError(f"{' '.join(words[:2])} failed; finished parts are kept")


if __name__ == "__main__":
    main(sys.argv[1:])
