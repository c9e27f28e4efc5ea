"""Do lived-in homes teach more than bare ones? Renders, trains, judges: hours on two cores.

Five sets of views, equally many, three seeds each, plan tiny for normals; judged on held-out homes
bare and dressed and, where named, on photographs with depth. Effects: out/study (or
PBRS_STUDY_FOLDER). Every view and every training is kept: what is cut off goes on.

    python -m benchmarks.study.lived_in                            all of it
    python -m benchmarks.study.lived_in --render bare_fast made    some roots alone
    python -m benchmarks.study.lived_in --train --seeds 1          what is rendered, with fewer seeds
    python -m benchmarks.study.lived_in --on photos=/my/rgbd       photographs judge, too
    python -m benchmarks.study.lived_in --train --rows bare_fast bare_photo --set steps=600
"""

from __future__ import annotations

import argparse
import sys

import pbrs_farm.cli
from benchmarks.study.rendered import FOLDER, HELD_OUT, ROOTS, rendered

VIEWS = 250  # of each set, at most: all sets have as many as the smallest
ROWS = {
    "bare_fast": "{bare_fast}@mlt_il_ol",
    "bare_photo": "{bare_photo}@mlt_il_ol",
    "dressed": "{dressed}@mlt_il_ol",
    "dressed_opengl_dl": "{dressed}@opengl_dl",
    "made_and_dressed": "{dressed}+{made}@mlt_il_ol",
}
"""Set of views -> roots and light."""
RUNS = FOLDER / "lived_in"


def main(words: list[str] | None = None) -> None:
    """Print the table and leave it in out/study/lived_in/table.md."""
    args = _arguments(words or [])
    wanted = [] if args.train else args.render or list(ROOTS)
    for name in wanted:
        rendered(name, jobs=args.jobs)
    if args.render is None:
        _compare(args)


def _arguments(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.study.lived_in")
    parser.add_argument("--render", nargs="+", choices=list(ROOTS), help="these roots alone")
    parser.add_argument("--train", action="store_true", help="with the roots as they are")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2, help="processes that render")
    parser.add_argument("--on", nargs="+", default=[], metavar="PHOTOGRAPHS")
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--views", type=int, default=VIEWS, help="of each set, at most")
    parser.add_argument("--set", nargs="+", default=[], metavar="FIELD=VALUE", help="of the plan")
    return parser.parse_args(words)


def _compare(args: argparse.Namespace) -> None:
    roots = {name: FOLDER / name for name in ROOTS}
    rows = [f"{name}={ROWS[name].format(**roots)}" for name in args.rows]
    words = ["ablation", *rows, "--task", "normals", "--seeds", str(args.seeds)]
    words += ["--views", str(args.views)]
    # Homes judge as far as they are rendered.
    judges = {"bare": roots["bare_photo"], "dressed": roots["dressed"]}
    on = [f"{name}={root}" for name, root in judges.items() if root.exists()]
    for place in (*on, *args.on):
        words += ["--on", place]
    for field in args.set:
        words += ["--set", field]
    if pbrs_farm.cli.main([*words, "--hold-out", *HELD_OUT, "--out", str(RUNS)]):
        raise RuntimeError("the comparison failed; what is trained is kept")


if __name__ == "__main__":
    main(sys.argv[1:])
