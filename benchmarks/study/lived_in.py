"""Do lived-in homes teach more than bare ones? Renders, trains, judges: hours on two cores.

Five sets of views, equally many, three seeds each, plan tiny for normals; judged on held-out homes
bare and dressed and, where named, on photographs with depth. Effects: out/study (or
PBRS_STUDY_FOLDER). Every view and every training is kept: what is cut off goes on.

    python -m benchmarks.study.lived_in                            all of it
    python -m benchmarks.study.lived_in --render bare_fast made    some roots alone
    python -m benchmarks.study.lived_in --train --seeds 1          what is rendered, with fewer seeds
    python -m benchmarks.study.lived_in --on photos=/my/rgbd       photographs judge, too
"""

from __future__ import annotations

import argparse
import sys

import pbrs_farm.cli
from benchmarks.study.rendered import FOLDER, HELD_OUT, ROOTS, rendered

VIEWS = 250  # of each set, at most: all sets have as many as the smallest
RUNS = FOLDER / "lived_in"


def main(words: list[str] | None = None) -> None:
    """Print the table and leave it in out/study/lived_in/table.md."""
    args = _arguments(words or [])
    wanted = [] if args.train else args.render or list(ROOTS)
    for name in wanted:
        rendered(name, jobs=args.jobs)
    if args.render is None:
        _compare(args.on, args.seeds)


def _arguments(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.study.lived_in")
    parser.add_argument("--render", nargs="+", choices=list(ROOTS), help="these roots alone")
    parser.add_argument("--train", action="store_true", help="with the roots as they are")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2, help="processes that render")
    parser.add_argument("--on", nargs="+", default=[], metavar="PHOTOGRAPHS")
    return parser.parse_args(words)


def _compare(photographs: list[str], n_seeds: int) -> None:
    roots = {name: FOLDER / name for name in ROOTS}
    fast, photo, dressed, made = roots.values()
    rows = [
        f"bare_fast={fast}@mlt_il_ol", f"bare_photo={photo}@mlt_il_ol",
        f"dressed={dressed}@mlt_il_ol", f"dressed_opengl_dl={dressed}@opengl_dl",
        f"made_and_dressed={dressed}+{made}@mlt_il_ol",
    ]  # fmt: skip
    words = ["ablation", *rows, "--task", "normals", "--seeds", str(n_seeds), "--views", str(VIEWS)]
    for on in (f"bare={photo}", f"dressed={dressed}", *photographs):
        words += ["--on", on]
    if pbrs_farm.cli.main([*words, "--hold-out", *HELD_OUT, "--out", str(RUNS)]):
        raise RuntimeError("the comparison failed; what is trained is kept")


if __name__ == "__main__":
    main(sys.argv[1:])
